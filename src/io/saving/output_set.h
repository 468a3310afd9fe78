#pragma once

#include <filesystem>
#include <mutex>
#include <vector>

#include "io/saving/atomic_file.h"
#include "io/saving/atomic_folder.h"

namespace tomofield::io {

/// Collects the results of a command, which appear together or not at all.
///
///   OutputSet results;
///   …write files by AtomicFile, in this thread and those of its parallel_for…
///   results.commit();
///
/// From its construction on, every AtomicFile::commit() of its thread, and of those that help it in
/// a parallel_for, adds its file to the set, and the files get their names in commit(). A thread
/// has one set at a time; those of other threads have nothing to do with it. Without commit() all
/// files are removed, and what they would replace stays.
class OutputSet {
 public:
  OutputSet();
  struct OneFile {};
  static constexpr OneFile kOneFile{};
  /// Makes a set that other files do not join.
  explicit OutputSet(OneFile) {}
  ~OutputSet();
  OutputSet(const OutputSet&) = delete;
  OutputSet& operator=(const OutputSet&) = delete;

  /// Returns the set that files of this thread join now, or null.
  static OutputSet* active();

  /// Adds a file that is flushed.
  void add(AtomicFile file);
  /// Adds a folder of results.
  void add(AtomicFolder folder);
  /// Lets commit() remove a file that would contradict the new ones, if it exists.
  void remove_old(const std::filesystem::path& path);
  /// Returns where the contents of a result are until commit(): in its temporary file. For other
  /// files, returns `path`.
  std::filesystem::path location_of(const std::filesystem::path& path) const;
  /// Returns true if a file is in the set.
  bool contains(const std::filesystem::path& path) const { return location_of(path) != path; }

  /// Gives all files their names. If one cannot get it, gives back the old files where that is
  /// possible, and throws Error with the name and the reason. A process that is killed during the
  /// renames leaves some new and some old files, all of them whole.
  void commit();
  /// Drops all files but one and commits that. Returns false if it is not in the set.
  bool commit_only(const std::filesystem::path& path);

 private:
  struct Change;
  void make_changes(std::vector<Change>& changes) const;

  bool is_active_ = false;
  mutable std::mutex mutex_;  // guards the members below
  std::vector<AtomicFile> files_;
  std::vector<AtomicFolder> folders_;
  std::vector<std::filesystem::path> to_remove_;
};

}  // namespace tomofield::io
