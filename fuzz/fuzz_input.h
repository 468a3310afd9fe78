#pragma once

#include <sys/mman.h>
#include <unistd.h>

#include <cstddef>
#include <cstdint>
#include <cstdlib>
#include <filesystem>
#include <string>
#include <utility>

#include "tomofield/error.h"

namespace tomofield::fuzz {

/// A file in memory that holds an input. Readers open it by its path.
class InputFile {
 public:
  InputFile(const void* data, std::size_t size) : descriptor_(memfd_create("input", MFD_CLOEXEC)) {
    if (descriptor_ < 0 || ::write(descriptor_, data, size) != static_cast<ssize_t>(size))
      std::abort();
  }
  ~InputFile() { ::close(descriptor_); }
  InputFile(const InputFile&) = delete;
  InputFile& operator=(const InputFile&) = delete;

  std::filesystem::path path() const { return "/proc/self/fd/" + std::to_string(descriptor_); }

 private:
  int descriptor_;
};

/// Calls a reader, which may refuse its input with Error. Anything else that it throws is a
/// finding.
template <typename Read>
void refuse_or(Read&& read) {
  try {
    std::forward<Read>(read)();
  } catch (const Error&) {
  }
}

}  // namespace tomofield::fuzz
