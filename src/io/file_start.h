#pragma once

#include <filesystem>
#include <string_view>

namespace tomofield::io {

/// Tells whether a file begins with a text, by which it is recognised. A file that is absent or
/// cannot be read does not.
bool begins_with(const std::filesystem::path& file, std::string_view text);

}  // namespace tomofield::io
