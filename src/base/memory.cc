#include "base/memory.h"

#include <fmt/core.h>

#include <fstream>
#include <string>

#include "tomofield/error.h"

namespace tomofield::base {

namespace {

// Returns the bytes of a line "KEY: n kB" of a file in /proc, or 0 if there is none.
std::size_t bytes_in(const char* path, const std::string& key) {
  std::ifstream file(path);
  std::string line;
  while (std::getline(file, line))
    if (line.rfind(key, 0) == 0) return std::size_t{std::stoull(line.substr(key.size()))} << 10;
  return 0;
}

}  // namespace

std::size_t available_memory() { return bytes_in("/proc/meminfo", "MemAvailable:"); }

std::size_t peak_memory() { return bytes_in("/proc/self/status", "VmHWM:"); }

void require_memory(std::size_t needed, const char* noun, const char* advice) {
  const std::size_t available = available_memory();
  if (available == 0 || needed <= available) return;
  constexpr double kGibibyte = 1 << 30;
  throw Error(fmt::format("{} needs about {:.1f} GiB of memory and {:.1f} GiB are available: {}",
                          noun, static_cast<double>(needed) / kGibibyte,
                          static_cast<double>(available) / kGibibyte, advice));
}

}  // namespace tomofield::base
