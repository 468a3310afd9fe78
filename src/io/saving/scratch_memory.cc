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

#include "base/utf8.h"
#include "tomofield/error.h"

namespace tomofield::io {
namespace {

std::mutex g_mutex;  // guards writing the two below
std::array<char, 8192> g_fault_text;
std::atomic<std::size_t> g_fault_length{0};

// Makes the line ready that scratch_fault() returns, because its handler cannot.
void prepare_fault(const char* noun, const std::filesystem::path& directory) {
  const std::string line = fmt::format(
      "\ntomofield: the scratch file with {} in '{}' cannot be kept: the file system there has "
      "less "
      "room than it said, or has failed; free some space there, or write to another folder\n",
      noun, base::printable(directory.string()));
  const std::lock_guard guard(g_mutex);
  g_fault_length = 0;
  g_fault_length = line.copy(g_fault_text.data(), g_fault_text.size());
}

void* map_memory(std::size_t bytes, const char* noun) {
  void* memory = mmap(nullptr, bytes, PROT_READ | PROT_WRITE, MAP_PRIVATE | MAP_ANONYMOUS, -1, 0);
  if (memory == MAP_FAILED)
    throw Error(fmt::format("not enough memory for {}: {} bytes", noun, bytes));
  return memory;
}

void* map_file(std::size_t bytes, const char* noun, const std::filesystem::path& directory) {
  std::string name = (directory / "tomofield-scratch-XXXXXX").string();
  const int fd = mkstemp(name.data());
  if (fd < 0) {
    throw Error(fmt::format("cannot make a scratch file in {} ({}): {} need {} bytes there",
                            directory.string(), std::strerror(errno), noun, bytes));
  }
  unlink(name.c_str());
  prepare_fault(noun, directory);
  void* memory = MAP_FAILED;
  int code = posix_fallocate(fd, 0, static_cast<off_t>(bytes));
  if (code == 0) {
    memory = mmap(nullptr, bytes, PROT_READ | PROT_WRITE, MAP_SHARED, fd, 0);
    code = errno;
  }
  close(fd);
  if (memory == MAP_FAILED) {
    throw Error(fmt::format("cannot reserve {} bytes for {} in {} ({}): free some space there",
                            bytes, noun, directory.string(), std::strerror(code)));
  }
  return memory;
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
      is_in_file_(bytes > in_memory_bytes),
      data_(static_cast<std::byte*>(is_in_file_ ? map_file(size_, noun, directory)
                                                : map_memory(size_, noun))) {}

ScratchMemory::ScratchMemory(ScratchMemory&& other) noexcept
    : size_(other.size_),
      is_in_file_(other.is_in_file_),
      data_(std::exchange(other.data_, nullptr)) {}

ScratchMemory::~ScratchMemory() {
  if (data_ != nullptr) munmap(data_, size_);
}

void ScratchMemory::advise(std::size_t first, std::size_t count, int advice) const {
  const auto page = static_cast<std::size_t>(sysconf(_SC_PAGESIZE));
  const std::size_t begin = (first + page - 1) / page * page, end = (first + count) / page * page;
  if (end > begin) madvise(data_ + begin, end - begin, advice);
}

// The pages stay in the kernel's cache as long as there is memory for them.
void ScratchMemory::release(std::size_t first, std::size_t count) const {
  if (is_in_file_) advise(first, count, MADV_DONTNEED);
}

void ScratchMemory::discard(std::size_t first, std::size_t count) const {
  release(first, count);
  advise(first, count, is_in_file_ ? MADV_REMOVE : MADV_DONTNEED);
}

}  // namespace tomofield::io
