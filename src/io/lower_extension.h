#pragma once

#include <algorithm>
#include <cctype>
#include <filesystem>
#include <string>

namespace tomofield::io {

/// Returns the extension of a file's name in lower case, ".mrc" of "TS.MRC".
inline std::string lower_extension(const std::filesystem::path& path) {
  std::string extension = path.extension().string();
  std::ranges::transform(extension, extension.begin(),
                         [](unsigned char c) { return static_cast<char>(std::tolower(c)); });
  return extension;
}

}  // namespace tomofield::io
