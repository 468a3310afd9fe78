#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>

namespace tomofield::io {

/// An open regular file that any number of threads read and write at 64-bit byte offsets. Failures
/// throw Error and name the file.
class PositionedFile {
 public:
  enum class Access { kRead, kReadWrite, kNew };  ///< kNew makes the file, which must not exist

  PositionedFile(const std::filesystem::path& path, Access access);
  ~PositionedFile();
  PositionedFile(PositionedFile&& other) noexcept;
  PositionedFile& operator=(PositionedFile&& other) noexcept;

  const std::filesystem::path& path() const { return path_; }
  std::int64_t size() const;

  /// Reads exactly `bytes` bytes. Throws Error if the file ends before.
  void read_at(std::int64_t offset, void* out, std::size_t bytes) const;
  void write_at(std::int64_t offset, const void* data, std::size_t bytes) const;

  /// Sets the length. Parts that were never written read as zeros and take no space.
  void resize(std::int64_t bytes) const;
  void close();

 private:
  std::filesystem::path path_;
  int descriptor_ = -1;
};

}  // namespace tomofield::io
