#include "io/named_file.h"

#include <algorithm>

#include "io/is_file.h"

namespace tomofield::io {

namespace fs = std::filesystem;
namespace {

// Returns the end of a path that has one folder less, or an empty path.
fs::path without_first(const fs::path& path) {
  fs::path rest;
  for (auto part = path.begin(); part != path.end(); ++part)
    if (part != path.begin()) rest /= *part;
  return rest;
}

// Tells whether a path begins at a root: "/data", "D:\\data", "\\\\server".
bool is_absolute(std::string_view path) {
  return path.starts_with('/') || path.starts_with('\\') || (path.size() > 1 && path[1] == ':');
}

std::optional<fs::path> in_folders(const fs::path& name, std::span<const fs::path> folders) {
  for (const fs::path& folder : folders)
    if (is_file(folder / name)) return folder / name;
  return std::nullopt;
}

}  // namespace

std::optional<fs::path> find_named_file(std::string_view name, std::span<const fs::path> folders) {
  if (!is_absolute(name)) return in_folders(name, folders);
  if (is_file(name)) return name;
  std::string slashes(name);
  std::ranges::replace(slashes, '\\', '/');
  for (fs::path rest = fs::path(slashes).relative_path(); !rest.empty(); rest = without_first(rest))
    if (auto found = in_folders(rest, folders)) return found;
  return std::nullopt;
}

std::string without_folders(std::string_view path) {
  return std::string(path.substr(path.find_last_of("/\\") + 1));
}

}  // namespace tomofield::io
