#include "io/saving/positioned_file.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>
#include <utility>

#include "tomofield/error.h"

namespace tomofield::io {

static_assert(sizeof(off_t) == 8, "files beyond 2 GiB need 64-bit offsets");

namespace {

[[noreturn]] void throw_system_error(const char* verb, const std::filesystem::path& path) {
  throw Error(fmt::format("cannot {} '{}': {}", verb, path.string(), std::strerror(errno)));
}

}  // namespace

PositionedFile::PositionedFile(const std::filesystem::path& path, Access access) : path_(path) {
  const int flags = access == Access::kRead        ? O_RDONLY
                    : access == Access::kReadWrite ? O_RDWR
                                                   : O_RDWR | O_CREAT | O_EXCL;
  // O_NONBLOCK prevents waiting for a pipe, which is refused below.
  descriptor_ = ::open(path.c_str(), flags | O_CLOEXEC | O_NONBLOCK, 0666);
  if (descriptor_ < 0) throw_system_error("open", path);
  struct stat status {};
  const int error = ::fstat(descriptor_, &status) == 0 ? 0 : errno;
  if (error == 0 && S_ISREG(status.st_mode)) return;
  ::close(std::exchange(descriptor_, -1));
  if (error == 0) throw Error(fmt::format("'{}' is not a regular file", path.string()));
  errno = error;
  throw_system_error("examine", path);
}

PositionedFile::~PositionedFile() {
  if (descriptor_ >= 0) ::close(descriptor_);
}

PositionedFile::PositionedFile(PositionedFile&& other) noexcept
    : path_(std::move(other.path_)), descriptor_(std::exchange(other.descriptor_, -1)) {}

PositionedFile& PositionedFile::operator=(PositionedFile&& other) noexcept {
  std::swap(path_, other.path_);
  std::swap(descriptor_, other.descriptor_);
  return *this;
}

std::int64_t PositionedFile::size() const {
  struct stat status {};
  if (::fstat(descriptor_, &status) != 0) throw_system_error("examine", path_);
  return status.st_size;
}

void PositionedFile::read_at(std::int64_t offset, void* out, std::size_t bytes) const {
  auto* cursor = static_cast<std::byte*>(out);
  while (bytes > 0) {
    const ssize_t count = ::pread(descriptor_, cursor, bytes, offset);
    if (count < 0 && errno == EINTR) continue;
    if (count < 0) throw_system_error("read", path_);
    if (count == 0) {
      throw Error(fmt::format("'{}' ends at byte {} although {} more bytes were expected there",
                              path_.string(), offset, bytes));
    }
    cursor += count;
    offset += count;
    bytes -= static_cast<std::size_t>(count);
  }
}

void PositionedFile::write_at(std::int64_t offset, const void* data, std::size_t bytes) const {
  const auto* cursor = static_cast<const std::byte*>(data);
  while (bytes > 0) {
    const ssize_t count = ::pwrite(descriptor_, cursor, bytes, offset);
    if (count < 0 && errno == EINTR) continue;
    if (count < 0) throw_system_error("write", path_);
    cursor += count;
    offset += count;
    bytes -= static_cast<std::size_t>(count);
  }
}

void PositionedFile::resize(std::int64_t bytes) const {
  if (::ftruncate(descriptor_, bytes) != 0) throw_system_error("set the length of", path_);
}

void PositionedFile::close() {
  const int descriptor = std::exchange(descriptor_, -1);
  if (descriptor >= 0 && ::close(descriptor) != 0) throw_system_error("close", path_);
}

}  // namespace tomofield::io
