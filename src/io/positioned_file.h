#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>

namespace tomofield::io {

/// An open regular file that is read and written at 64-bit byte offsets, from
/// any number of threads. Failures are tomofield::Error and name the file.
class PositionedFile {
 public:
  enum class Access { kRead, kReadWrite };

  PositionedFile(const std::filesystem::path& path, Access access);
  ~PositionedFile();
  PositionedFile(PositionedFile&& other) noexcept;
  PositionedFile& operator=(PositionedFile&& other) noexcept;

  const std::filesystem::path& path() const { return path_; }
  std::int64_t size() const;

  /// Exactly `bytes` bytes; a file that ends before is an Error.
  void read_at(std::int64_t offset, void* out, std::size_t bytes) const;
  void write_at(std::int64_t offset, const void* data, std::size_t bytes) const;

  /// Sets the length; what was never written reads as zeros and takes no space.
  void resize(std::int64_t bytes) const;
  void close();

 private:
  std::filesystem::path path_;
  int descriptor_ = -1;
};

}  // namespace tomofield::io
