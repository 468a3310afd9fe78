#include "io/saving/atomic_folder.h"

#include <fmt/format.h>

#include <system_error>
#include <utility>

#include "io/saving/output_set.h"
#include "io/saving/output_target.h"
#include "tomofield/error.h"

namespace tomofield::io {

namespace fs = std::filesystem;

void require_replaceable_folder(const fs::path& path, const fs::path& marker) {
  const fs::file_status status = type_at(path);
  if (!fs::exists(status)) return;
  if (fs::is_symlink(status)) {
    throw Error(
        fmt::format("cannot replace '{}': it is a symbolic link, and links are not "
                    "replaced; give the name that it points to, or move it away",
                    path.string()));
  }
  if (fs::is_directory(status) && fs::is_regular_file(type_at(path / marker))) return;
  throw Error(
      fmt::format("cannot replace '{}': it is no folder of such results (it has no '{}'); "
                  "move it away, or give another name",
                  path.string(), marker.string()));
}

AtomicFolder::AtomicFolder(const fs::path& path, const fs::path& marker) : path_(path) {
  require_replaceable_folder(path, marker);
  std::error_code failed;
  while (temporary_path_.empty()) {
    const fs::path candidate = unused_temporary_name(path);
    if (fs::create_directory(candidate, failed)) temporary_path_ = candidate;
    if (failed) {
      throw Error(fmt::format("cannot write '{}': no folder can be made in '{}': {}", path.string(),
                              folder_of(path).string(), failed.message()));
    }
  }
}

AtomicFolder::~AtomicFolder() {
  std::error_code ignored;
  if (!temporary_path_.empty()) fs::remove_all(temporary_path_, ignored);
}

AtomicFolder::AtomicFolder(AtomicFolder&& other) noexcept
    : path_(std::move(other.path_)), temporary_path_(std::exchange(other.temporary_path_, {})) {}

void AtomicFolder::commit() {
  if (OutputSet* const collecting = OutputSet::active()) return collecting->add(std::move(*this));
  OutputSet alone(OutputSet::kOneFile);
  alone.add(std::move(*this));
  alone.commit();
}

}  // namespace tomofield::io
