#pragma once

#include <compare>
#include <cstdint>
#include <filesystem>

namespace tomofield::io {

/// Returns the path at the end of the links that `path` leads through, also if no file is there
/// yet; the folders before it may be links. A circle of links is returned as it is.
std::filesystem::path end_of_links(const std::filesystem::path& path);

/// Two paths have the same identity if they are the same file, however they are spelled and
/// whichever links lead there.
struct FileIdentity {
  std::uint64_t device = 0, inode = 0;  ///< of the file, or else of its folder
  std::filesystem::path name;           ///< in its folder, of a file that does not exist
  auto operator<=>(const FileIdentity&) const = default;
};

/// Returns the identity of the file that reading or writing `path` would meet, at the end of all
/// links. A file in a folder that does not exist yet has the whole path for its name.
FileIdentity identity_of(const std::filesystem::path& path);

}  // namespace tomofield::io
