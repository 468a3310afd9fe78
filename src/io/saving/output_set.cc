#include "io/saving/output_set.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>
#include <cstdio>
#include <cstring>
#include <set>
#include <utility>

#include "base/check.h"
#include "base/log.h"
#include "base/threads/parallel.h"
#include "io/saving/output_target.h"
#include "tomofield/error.h"

namespace tomofield::io {
namespace fs = std::filesystem;
namespace {

[[noreturn]] void throw_cannot_replace(const fs::path& target) {
  const int error = errno;
  throw Error(fmt::format("cannot replace '{}': {}", target.string(), std::strerror(error)));
}

// Returns true if a file has another name now. A server of NFS may have renamed it although its
// answer was lost and the call fails, so a failure counts only if the file is still where it was.
bool rename_file(const fs::path& from, const fs::path& to) {
  struct stat before {};
  struct stat after {};
  const bool is_known = ::lstat(from.c_str(), &before) == 0;
  if (std::rename(from.c_str(), to.c_str()) == 0) return true;
  const int error = errno;
  const bool is_there = is_known && ::lstat(to.c_str(), &after) == 0 &&
                        after.st_ino == before.st_ino && after.st_dev == before.st_dev;
  const bool is_gone = ::lstat(from.c_str(), &before) != 0 && errno == ENOENT;
  errno = error;
  return is_there && is_gone;
}

// Returns true if a file has a second name now, as rename_file() does.
bool link_file(const fs::path& file, const fs::path& second) {
  std::error_code absent;
  return ::link(file.c_str(), second.c_str()) == 0 || fs::equivalent(file, second, absent);
}

// Flushes a folder, so that a power cut does not undo a rename. Some file systems cannot do that;
// then the rename alone must suffice.
void flush_folder(const fs::path& folder) {
  const int descriptor = ::open(folder.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC);
  const bool is_flushed = descriptor >= 0 && ::fsync(descriptor) == 0;
  const int error = errno;
  if (descriptor >= 0) ::close(descriptor);
  if (!is_flushed && error != EINVAL && error != ENOTSUP && error != EACCES)
    base::log_warning(fmt::format("the folder '{}' cannot be flushed to the disk: {}",
                                  folder.string(), std::strerror(error)));
}

}  // namespace

// A file or a folder that got its name, or a file that was removed, and what had the name before.
struct OutputSet::Change {
  fs::path target;
  fs::path old;  // empty: there was none
  bool is_removal = false;
  bool is_folder = false;
  fs::path temporary{};  // what the new file was called before; empty: it has no other name yet

  // Keeps the file that is there under another name: as a second name where the file system has
  // that, so that the first is never missing.
  static Change begin(const fs::path& target, bool is_removal) {
    Change change{target, {}, is_removal, false};
    const fs::file_status status = type_at(target);
    if (!fs::exists(status)) return change;
    errno = EISDIR;
    if (fs::is_directory(status)) throw_cannot_replace(target);
    change.old = unused_temporary_name(target);
    const bool has_second_name = !is_removal && link_file(target, change.old);
    if (!has_second_name && !rename_file(target, change.old)) throw_cannot_replace(target);
    return change;
  }

  // Keeps the folder that is there under another name.
  static Change begin_folder(const fs::path& target) {
    Change change{target, {}, false, true};
    if (!fs::exists(type_at(target))) return change;
    change.old = unused_temporary_name(target);
    if (!rename_file(target, change.old)) throw_cannot_replace(target);
    return change;
  }

  // Removes what was replaced.
  void forget_old() const {
    if (old.empty()) return;
    std::error_code failed;
    if (is_folder)
      fs::remove_all(old, failed);
    else
      fs::remove(old, failed);
    if (failed)
      base::log_warning(fmt::format("'{}', which is replaced, cannot be removed: {}", old.string(),
                                    failed.message()));
  }

  // Gives back the old file or folder, and a new file its temporary name, so that commit_only() can
  // still keep it. Returns false if that is not possible.
  bool undo() const {
    const bool is_made = !temporary.empty();
    if (is_made && !is_folder && !link_file(target, temporary)) rename_file(target, temporary);
    if (old.empty() && !is_made) return true;
    if (is_folder) {
      std::error_code failed;
      if (is_made) fs::remove_all(target, failed);
      return !failed && (old.empty() || rename_file(old, target));
    }
    if (old.empty()) return ::unlink(target.c_str()) == 0 || errno == ENOENT;
    std::error_code absent;
    if (fs::equivalent(old, target, absent)) return ::unlink(old.c_str()) == 0;
    return rename_file(old, target);
  }
};

OutputSet::OutputSet() : is_active_(true) {
  TOMOFIELD_CHECK(active() == nullptr, "there is another set of results already");
  base::thread_context() = this;
}

OutputSet::~OutputSet() {
  if (is_active_) base::thread_context() = nullptr;
}

OutputSet* OutputSet::active() { return static_cast<OutputSet*>(base::thread_context()); }

void OutputSet::add(AtomicFile file) {
  const std::lock_guard guard(mutex_);
  files_.push_back(std::move(file));
}

void OutputSet::add(AtomicFolder folder) {
  const std::lock_guard guard(mutex_);
  folders_.push_back(std::move(folder));
}

void OutputSet::remove_old(const fs::path& path) {
  const std::lock_guard guard(mutex_);
  to_remove_.push_back(path);
}

fs::path OutputSet::location_of(const fs::path& path) const {
  const std::lock_guard guard(mutex_);
  for (const AtomicFile& file : files_)
    if (file.path() == path) return file.temporary_path();
  return path;
}

void OutputSet::make_changes(std::vector<Change>& changes) const {
  for (const fs::path& path : to_remove_) changes.push_back(Change::begin(path, true));
  for (const AtomicFile& file : files_) {
    changes.push_back(Change::begin(file.target_, false));
    if (!rename_file(file.temporary_path_, file.target_)) throw_cannot_replace(file.path_);
    changes.back().temporary = file.temporary_path_;
  }
  for (const AtomicFolder& folder : folders_) {
    changes.push_back(Change::begin_folder(folder.path_));
    if (!rename_file(folder.temporary_path_, folder.path_)) throw_cannot_replace(folder.path_);
    changes.back().temporary = folder.temporary_path_;
  }
}

void OutputSet::commit() {
  const std::lock_guard guard(mutex_);
  std::vector<Change> changes;
  try {
    make_changes(changes);
  } catch (const Error& error) {
    std::string lost;
    for (auto change = changes.rbegin(); change != changes.rend(); ++change) {
      if (change->undo()) continue;
      lost += change->old.empty()
                  ? fmt::format("; '{}' is new, and cannot be removed", change->target.string())
                  : fmt::format("; what was in '{}' is now in '{}'", change->target.string(),
                                change->old.string());
    }
    throw Error(error.what() + lost);
  }
  std::set<fs::path> folders;
  for (const Change& change : changes) folders.insert(folder_of(change.target));
  for (const fs::path& folder : folders) flush_folder(folder);
  for (const Change& change : changes) change.forget_old();
  for (AtomicFile& file : files_) file.temporary_path_.clear();
  for (AtomicFolder& folder : folders_) folder.temporary_path_.clear();
  files_.clear();
  folders_.clear();
  to_remove_.clear();
}

bool OutputSet::commit_only(const fs::path& path) {
  bool is_in_set = false;
  {
    const std::lock_guard guard(mutex_);
    std::vector<AtomicFile> kept;
    for (AtomicFile& file : files_)
      if (file.path() == path) kept.push_back(std::move(file));
    is_in_set = !kept.empty();
    files_.swap(kept);
    folders_.clear();
    to_remove_.clear();
  }
  if (is_in_set) commit();
  return is_in_set;
}

}  // namespace tomofield::io
