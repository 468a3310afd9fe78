#pragma once

#include <filesystem>

namespace tomofield::io {

/// Makes a folder for results, with the folders above it. Its destructor removes the folders that
/// it made if they are empty, so that a command that fails leaves nothing behind.
class OutputFolder {
 public:
  /// Throws Error if the folder cannot be made, or is something else.
  explicit OutputFolder(const std::filesystem::path& path);
  ~OutputFolder();
  OutputFolder(const OutputFolder&) = delete;
  OutputFolder& operator=(const OutputFolder&) = delete;

 private:
  std::filesystem::path path_;
  std::filesystem::path first_made_;  // empty: all were there
};

/// A directory for small files of one command, in its folder of results, which is locked. The
/// destructor removes it with all its contents.
class ScratchFolder {
 public:
  /// Removes what a killed command left. Throws Error if `folder` cannot be written.
  ScratchFolder(const std::filesystem::path& folder, const char* name);
  ~ScratchFolder();
  ScratchFolder(const ScratchFolder&) = delete;
  ScratchFolder& operator=(const ScratchFolder&) = delete;
  const std::filesystem::path& path() const { return path_; }

 private:
  std::filesystem::path path_;
};

}  // namespace tomofield::io
