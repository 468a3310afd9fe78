#pragma once

#include <filesystem>

namespace tomofield::io {

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
