#include "io/saving/scratch_memory.h"

#include <fcntl.h>
#include <fmt/core.h>
#include <sys/mman.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <cerrno>
#include <cstdlib>
#include <cstring>
#include <mutex>
#include <string>
#include <system_error>
#include <utility>
#include <vector>

#include "base/check.h"
#include "base/utf8.h"
#include "tomofield/error.h"

namespace tomofield::io {
namespace {

std::mutex g_fault_mutex;  // guards writing the two below
std::array<char, 8192> g_fault_text;
std::atomic<std::size_t> g_fault_length{0};

// Makes the line ready that scratch_fault() returns, because its handler cannot.
void prepare_fault(const char* noun, const std::filesystem::path& directory) {
  const std::string line = fmt::format(
      "\ntomofield: the scratch file with {} in '{}' cannot be read any more: the disk there has "
      "failed; write to another folder\n",
      noun, base::printable(directory.string()));
  const std::lock_guard guard(g_fault_mutex);
  g_fault_length = 0;
  g_fault_length = line.copy(g_fault_text.data(), g_fault_text.size());
}

std::byte* map_memory(std::size_t bytes, const char* noun) {
  void* memory = mmap(nullptr, bytes, PROT_READ | PROT_WRITE, MAP_PRIVATE | MAP_ANONYMOUS, -1, 0);
  if (memory == MAP_FAILED)
    throw Error(fmt::format("not enough memory for {}: {} bytes", noun, bytes));
  return static_cast<std::byte*>(memory);
}

// Writes all bytes. Returns 0, or the code of what went wrong.
int write_all(int file, std::size_t first, std::span<const std::byte> values) {
  while (!values.empty()) {
    const ssize_t count = pwrite(file, values.data(), values.size(), static_cast<off_t>(first));
    if (count < 0 && errno == EINTR) continue;
    if (count < 0) return errno;
    first += static_cast<std::size_t>(count);
    values = values.subspan(static_cast<std::size_t>(count));
  }
  return 0;
}

// Writes zeros, where the file system can reserve no room otherwise.
int write_zeros(int file, std::size_t bytes) {
  const std::vector<std::byte> zeros(std::min(bytes, std::size_t{1} << 20));
  for (std::size_t at = 0; at < bytes; at += zeros.size()) {
    const std::span part(zeros.data(), std::min(zeros.size(), bytes - at));
    if (const int code = write_all(file, at, part); code != 0) return code;
  }
  return fsync(file) == 0 ? 0 : errno;
}

}  // namespace

std::string_view scratch_fault() { return {g_fault_text.data(), g_fault_length}; }

std::filesystem::path scratch_directory(const std::filesystem::path& output) {
  std::error_code ignored;  // ScratchMemory says what is wrong with a folder that it needs
  if (output.empty()) return std::filesystem::temp_directory_path(ignored);
  return output.has_parent_path() ? output.parent_path() : std::filesystem::path(".");
}

ScratchMemory::ScratchMemory(std::size_t bytes, const char* noun,
                             const std::filesystem::path& directory, std::size_t in_memory_bytes)
    : size_(std::max<std::size_t>(bytes, 1)),  // nothing maps no bytes
      directory_(directory) {
  if (bytes > in_memory_bytes)
    make_file(noun);
  else
    data_ = map_memory(size_, noun);
}

ScratchMemory::ScratchMemory(ScratchMemory&& other) noexcept
    : size_(other.size_),
      directory_(std::move(other.directory_)),
      file_(std::exchange(other.file_, -1)),
      data_(std::exchange(other.data_, nullptr)) {}

ScratchMemory::~ScratchMemory() {
  if (data_ != nullptr) munmap(data_, size_);
  if (file_ >= 0) close(file_);
}

void ScratchMemory::make_file(const char* noun) {
  std::string name = (directory_ / "tomofield-scratch-XXXXXX").string();
  file_ = mkostemp(name.data(), O_CLOEXEC);
  if (file_ < 0) {
    throw Error(fmt::format("cannot make a scratch file in {} ({}): {} need {} bytes there",
                            directory_.string(), std::strerror(errno), noun, size_));
  }
  unlink(name.c_str());
  prepare_fault(noun, directory_);
  int code = reserve();
  void* memory = MAP_FAILED;
  if (code == 0) {
    memory = mmap(nullptr, size_, PROT_READ, MAP_SHARED, file_, 0);
    code = errno;
  }
  if (memory == MAP_FAILED) {
    close(std::exchange(file_, -1));
    if (code == ENOMEM)
      throw Error(
          fmt::format("not enough memory for {}: {} bytes of address space are needed, "
                      "which `ulimit -v` limits",
                      noun, size_));
    throw Error(fmt::format("cannot reserve {} bytes for {} in {} ({}): free some space there",
                            size_, noun, directory_.string(), std::strerror(code)));
  }
  data_ = static_cast<std::byte*>(memory);
}

int ScratchMemory::reserve() const {
  if (fallocate(file_, 0, 0, static_cast<off_t>(size_)) == 0) return 0;
  return errno == EOPNOTSUPP || errno == ENOSYS ? write_zeros(file_, size_) : errno;
}

void ScratchMemory::write(std::size_t first, std::span<const std::byte> values) {
  TOMOFIELD_CHECK(first <= size_ && values.size() <= size_ - first, "bytes within the array");
  if (file_ < 0) {
    std::ranges::copy(values, data_ + first);
    return;
  }
  const int code = write_all(file_, first, values);
  if (code == 0) return;
  throw Error(
      fmt::format("cannot write the scratch file in '{}' ({}): the file system there has less room "
                  "than it said, or has failed; free some space there, or write to another folder",
                  directory_.string(), std::strerror(code)));
}

ScratchMemory::Pages ScratchMemory::pages_within(std::size_t first, std::size_t count) const {
  const auto page = static_cast<std::size_t>(sysconf(_SC_PAGESIZE));
  const std::size_t begin = (first + page - 1) / page * page, end = (first + count) / page * page;
  return {begin, end > begin ? end - begin : 0};
}

// The pages stay in the kernel's cache as long as there is memory for them.
void ScratchMemory::release(std::size_t first, std::size_t count) const {
  const auto [begin, size] = pages_within(first, count);
  if (file_ >= 0 && size > 0) madvise(data_ + begin, size, MADV_DONTNEED);
}

void ScratchMemory::discard(std::size_t first, std::size_t count) const {
  const auto [begin, size] = pages_within(first, count);
  if (size == 0) return;
  madvise(data_ + begin, size, MADV_DONTNEED);
  if (file_ < 0) return;
  (void)!fallocate(file_, FALLOC_FL_PUNCH_HOLE | FALLOC_FL_KEEP_SIZE, static_cast<off_t>(begin),
                   static_cast<off_t>(size));
}

}  // namespace tomofield::io
