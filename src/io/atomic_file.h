#pragma once

#include <filesystem>
#include <string_view>

namespace tomofield::io {

/// Replaces a file as a whole or not at all. Readers of `path` see the old file until commit(), and
/// then the complete new one, even through a power cut.
///
///   AtomicFile file(path);
///   …write file.temporary_path() by any means, and close it…
///   file.commit();
///
/// Without commit() the temporary file is removed and `path` stays as it was.
class AtomicFile {
 public:
  /// Creates an empty temporary file in the directory of `path`, or of its target if `path` is a
  /// symbolic link. Throws Error at once if that directory does not exist or cannot be written, or
  /// if `path` exists and is no regular file. Removes temporary files that killed processes of this
  /// machine left for the same file.
  explicit AtomicFile(const std::filesystem::path& path);
  ~AtomicFile();
  AtomicFile(AtomicFile&& other) noexcept;
  AtomicFile& operator=(AtomicFile&&) = delete;

  const std::filesystem::path& path() const { return path_; }
  const std::filesystem::path& temporary_path() const { return temporary_path_; }

  /// Flushes the temporary file to the disk and gives it the final name.
  void commit();

 private:
  std::filesystem::path path_;
  std::filesystem::path target_;
  std::filesystem::path temporary_path_;  // empty once committed or moved from
};

/// Atomically makes `text` the whole contents of `path`.
void write_text_file(const std::filesystem::path& path, std::string_view text);

}  // namespace tomofield::io
