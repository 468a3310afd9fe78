#include "io/saving/output_folder.h"

#include <fmt/format.h>

#include <system_error>

#include "tomofield/error.h"

namespace tomofield::io {
namespace fs = std::filesystem;

OutputFolder::OutputFolder(const fs::path& path) : path_(fs::absolute(path).lexically_normal()) {
  if (!path_.has_filename()) path_ = path_.parent_path();  // a slash at the end
  std::error_code error;
  for (fs::path folder = path_; !fs::exists(folder, error); folder = folder.parent_path())
    first_made_ = folder;
  fs::create_directories(path_, error);
  if (!error && fs::is_directory(path_)) return;
  throw Error(
      fmt::format("the folder '{}' cannot be made ({}): give another with -o that can be written",
                  path.string(), error ? error.message() : "something else has that name"));
}

OutputFolder::~OutputFolder() {
  if (first_made_.empty()) return;
  std::error_code error;
  fs::path folder = path_;
  while (fs::remove(folder, error) && folder != first_made_) folder = folder.parent_path();
}

namespace fs = std::filesystem;

ScratchFolder::ScratchFolder(const fs::path& folder, const char* name) : path_(folder / name) {
  std::error_code error;
  fs::remove_all(path_, error);
  if (fs::create_directory(path_, error)) return;
  throw Error(fmt::format("the folder '{}' cannot be written ({}): give another with -o",
                          folder.string(), error.message()));
}

ScratchFolder::~ScratchFolder() {
  std::error_code ignored;
  fs::remove_all(path_, ignored);
}

}  // namespace tomofield::io
