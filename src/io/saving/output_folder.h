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

}  // namespace tomofield::io
