#pragma once

#include <filesystem>

namespace tomofield::io {

/// Makes or replaces a folder of results as a whole or not at all, as AtomicFile does for a file.
///
///   AtomicFolder folder(path, ".zgroup");
///   …write files in folder.temporary_path()…
///   folder.commit();
///
/// Without commit() the temporary folder is removed and `path` stays as it was.
class AtomicFolder {
 public:
  /// Makes an empty temporary folder beside `path`. Throws Error if it cannot be made, or if
  /// something is at `path` that is no folder of the same kind: only one that has a file `marker`
  /// may be replaced.
  AtomicFolder(const std::filesystem::path& path, const std::filesystem::path& marker);
  ~AtomicFolder();
  AtomicFolder(AtomicFolder&& other) noexcept;
  AtomicFolder& operator=(AtomicFolder&&) = delete;

  const std::filesystem::path& path() const { return path_; }
  const std::filesystem::path& temporary_path() const { return temporary_path_; }

  /// Gives the temporary folder the final name. While the process collects its results in an
  /// OutputSet, the folder joins it and gets its name with the files.
  void commit();

 private:
  friend class OutputSet;

  std::filesystem::path path_;
  std::filesystem::path temporary_path_;  // empty once committed or moved from
};

/// Throws Error if something is at `path` that AtomicFolder would not replace.
void require_replaceable_folder(const std::filesystem::path& path,
                                const std::filesystem::path& marker);

}  // namespace tomofield::io
