#pragma once

#include <filesystem>
#include <optional>
#include <span>
#include <string>
#include <string_view>

namespace tomofield::io {

/// Returns where a file lies that another file names, or nothing if it is in none of the places
/// that are tried. A relative name is looked for from each of `folders`. An absolute one, of Unix
/// or of Windows, is tried as it is. If there is no such file, as after a project was moved or
/// copied, ever shorter ends of it ("project/dir/a.mrc", "dir/a.mrc", "a.mrc") are looked for from
/// each folder.
std::optional<std::filesystem::path> find_named_file(
    std::string_view name, std::span<const std::filesystem::path> folders);

/// Returns the last part of a path of Windows or of Unix: what it names in its folder.
std::string without_folders(std::string_view path);

}  // namespace tomofield::io
