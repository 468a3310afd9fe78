#include "io/saving/file_identity.h"

#include <sys/stat.h>

#include <system_error>

#include "io/saving/output_target.h"

namespace tomofield::io {

namespace fs = std::filesystem;

fs::path end_of_links(const fs::path& path) {
  constexpr int kMostLinks = 40;  // as the system follows
  fs::path end = path;
  for (int link = 0; link < kMostLinks; ++link) {
    std::error_code is_none;
    const fs::path next = fs::read_symlink(end, is_none);
    if (is_none) return end;
    end = folder_of(end) / next;  // which is `next` if that is absolute
  }
  return path;
}

FileIdentity identity_of(const fs::path& path) {
  struct stat found {};
  if (::stat(path.c_str(), &found) == 0) return {found.st_dev, found.st_ino, {}};
  std::error_code failed;
  const fs::path end = end_of_links(path);
  fs::path target = fs::weakly_canonical(end, failed);
  if (failed) target = fs::absolute(end, failed).lexically_normal();
  if (::stat(folder_of(target).c_str(), &found) == 0)
    return {found.st_dev, found.st_ino, target.filename()};
  return {0, 0, target};
}

}  // namespace tomofield::io
