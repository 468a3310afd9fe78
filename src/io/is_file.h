#pragma once

#include <filesystem>
#include <system_error>

namespace tomofield::io {

/// Returns true if a regular file lies at a path. A path that cannot be looked at has none.
inline bool is_file(const std::filesystem::path& path) {
  std::error_code failed;
  return std::filesystem::is_regular_file(path, failed);
}

}  // namespace tomofield::io
