#pragma once

#include <cstddef>
#include <filesystem>
#include <span>
#include <string_view>

namespace tomofield::io {

/// Returns the folder for scratch files of a run that writes `output`: the folder of the output,
/// which has room, or that of the system if no file is written.
std::filesystem::path scratch_directory(const std::filesystem::path& output);

/// Returns a line that says why SIGBUS came, if it came because the disk of the last scratch file
/// could not be read. Returns an empty text if there has been no scratch file. A handler of signals
/// may call it.
std::string_view scratch_fault();

/// Zeroed bytes for what is needed during one run. A small array lies in memory, a large one in an
/// unlinked file that the kernel pages, so that it may be larger than the memory. All is written by
/// write(), which tells of a full disk: a store into a mapped page would end the process there.
class ScratchMemory {
 public:
  /// Up to here an array is kept in memory: a 1K series of 60 views takes 250 MB.
  static constexpr std::size_t kInMemoryBytes = std::size_t{1} << 30;

  /// Makes the file in `directory` if `bytes` are more than `in_memory_bytes`. Throws Error if
  /// there is no room; `noun` names the array in its message, in the plural.
  ScratchMemory(std::size_t bytes, const char* noun, const std::filesystem::path& directory,
                std::size_t in_memory_bytes = kInMemoryBytes);
  ~ScratchMemory();
  ScratchMemory(ScratchMemory&& other) noexcept;
  ScratchMemory& operator=(ScratchMemory&&) = delete;

  /// Returns the size of the file that holds `bytes` bytes: 0 if they are kept in memory.
  static std::size_t bytes_in_file(std::size_t bytes) { return bytes > kInMemoryBytes ? bytes : 0; }

  const std::byte* data() const { return data_; }
  std::size_t size() const { return size_; }

  /// Throws Error if the file cannot be written, as where a file system has promised room that it
  /// does not have. Threads may write different bytes at once.
  void write(std::size_t first, std::span<const std::byte> values);

  /// Removes a part that lies in a file from this process's memory; it keeps its values and comes
  /// back when it is used. Only whole pages are removed.
  void release(std::size_t first, std::size_t count) const;
  /// Gives up the values of a part and returns its memory, or its place in the file where the file
  /// system can do that. Only whole pages are returned.
  void discard(std::size_t first, std::size_t count) const;

 private:
  struct Pages {
    std::size_t begin, size;  // in bytes
  };
  Pages pages_within(std::size_t first, std::size_t count) const;
  void make_file(const char* noun);
  int reserve() const;  // returns 0, or the code of what went wrong

  std::size_t size_;
  std::filesystem::path directory_;
  int file_ = -1;  // or none
  std::byte* data_ = nullptr;
};

}  // namespace tomofield::io
