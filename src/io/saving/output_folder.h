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

/// A directory for what a child process plans and says, in a folder of results, which is locked.
/// The destructor removes these two files and the directory. It leaves files of others.
class ScratchFolder {
 public:
  /// Removes what a killed command left. Throws Error if `folder` cannot be written, or if others
  /// have put files into the directory.
  ScratchFolder(const std::filesystem::path& folder, const char* name);
  ~ScratchFolder();
  ScratchFolder(const ScratchFolder&) = delete;
  ScratchFolder& operator=(const ScratchFolder&) = delete;
  std::filesystem::path plan() const;
  std::filesystem::path log() const;

 private:
  std::filesystem::path path_;
};

}  // namespace tomofield::io
