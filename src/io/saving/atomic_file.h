#pragma once

#include <sys/stat.h>

#include <filesystem>
#include <optional>
#include <string_view>

#include "io/saving/output_lock.h"

namespace tomofield::io {

/// Replaces a file as a whole or not at all. Readers of `path` see the old file until commit(), and
/// then the complete new one, even through a power cut. A file that is replaced keeps its
/// permissions, and its owner and group as far as the system lets this user give them.
///
///   AtomicFile file(path);
///   …write file.temporary_path() by any means, and close it…
///   file.commit();
///
/// Without commit() the temporary file is removed and `path` stays as it was. The file is locked
/// for as long as the object lives (OutputLock).
class AtomicFile {
 public:
  /// Creates an empty temporary file in the directory of `path`, or of its target if `path` is a
  /// symbolic link. Throws Error at once if that directory does not exist or cannot be written, if
  /// `path` exists and is no regular file, or if another process writes it.
  explicit AtomicFile(const std::filesystem::path& path);
  ~AtomicFile();
  AtomicFile(AtomicFile&& other) noexcept;
  AtomicFile& operator=(AtomicFile&&) = delete;

  const std::filesystem::path& path() const { return path_; }
  const std::filesystem::path& temporary_path() const { return temporary_path_; }

  /// Flushes the temporary file to the disk and gives it the final name. While the process collects
  /// its results in an OutputSet, the file joins it and gets its name with the others.
  void commit();

 private:
  friend class OutputSet;
  void flush();

  std::filesystem::path path_;
  std::filesystem::path target_;
  OutputLock lock_;
  std::optional<struct stat> replaced_;   // the file that is there
  int descriptor_ = -1;                   // of the temporary file, until it is flushed
  std::filesystem::path temporary_path_;  // empty once committed or moved from
};

/// Atomically makes `text` the whole contents of `path`.
void write_text_file(const std::filesystem::path& path, std::string_view text);

}  // namespace tomofield::io
