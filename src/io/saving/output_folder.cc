#include "io/saving/output_folder.h"

#include <fmt/format.h>

#include <string>
#include <system_error>

#include "tomofield/error.h"

namespace tomofield::io {
namespace fs = std::filesystem;

namespace {

constexpr const char *kPlan = "plan.json", *kLog = "log";

// Removes a scratch folder, with the lock and temporary files of its plan. If others have put
// something into it, that stays, and so does the folder.
void remove_scratch(const fs::path& folder) {
  std::error_code error;
  if (!fs::is_directory(fs::symlink_status(folder, error))) return;
  for (const auto& entry : fs::directory_iterator(folder, error)) {
    const std::string name = entry.path().filename().string();
    const bool is_of_plan = name.starts_with(fmt::format(".{}.", kPlan));
    if (name == kPlan || name == kLog || is_of_plan) fs::remove(entry.path(), error);
  }
  fs::remove(folder, error);
}

}  // namespace

OutputFolder::OutputFolder(const fs::path& path) : path_(fs::absolute(path).lexically_normal()) {
  if (!path_.has_filename()) path_ = path_.parent_path();  // a slash at the end
  std::error_code error;
  for (fs::path folder = path_; !fs::exists(folder, error); folder = folder.parent_path())
    first_made_ = folder;
  fs::create_directories(path_, error);
  if (!error && fs::is_directory(path_)) return;
  throw Error(fmt::format("the folder '{}' cannot be made ({}): give another folder", path.string(),
                          error ? error.message() : "something else has that name"));
}

OutputFolder::~OutputFolder() {
  if (first_made_.empty()) return;
  std::error_code error;
  fs::path folder = path_;
  while (fs::remove(folder, error) && folder != first_made_) folder = folder.parent_path();
}

ScratchFolder::ScratchFolder(const fs::path& folder, const char* name) : path_(folder / name) {
  remove_scratch(path_);
  std::error_code error;
  if (fs::create_directory(path_, error)) return;
  if (fs::exists(fs::symlink_status(path_)))
    throw Error(fmt::format(
        "'{}' is not of tomofield, or holds files that it did not put there: move it away",
        path_.string()));
  throw Error(fmt::format("the folder '{}' cannot be written ({}): give another folder",
                          folder.string(), error.message()));
}

ScratchFolder::~ScratchFolder() { remove_scratch(path_); }

fs::path ScratchFolder::plan() const { return path_ / kPlan; }
fs::path ScratchFolder::log() const { return path_ / kLog; }

}  // namespace tomofield::io
