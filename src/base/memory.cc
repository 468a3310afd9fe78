#include "base/memory.h"

#include <fmt/core.h>
#include <sys/resource.h>

#include <fstream>
#include <string>

#include "tomofield/error.h"

namespace tomofield::base {

// Reads MemAvailable, which Linux reports.
std::size_t available_memory() {
  std::ifstream file("/proc/meminfo");
  std::string line;
  constexpr const char* kKey = "MemAvailable:";
  while (std::getline(file, line)) {
    if (line.rfind(kKey, 0) == 0) {
      return std::size_t{std::stoull(line.substr(std::string(kKey).size()))} << 10;
    }
  }
  return 0;
}

std::size_t peak_memory() {
  rusage usage{};
  if (getrusage(RUSAGE_SELF, &usage) != 0) return 0;
  return static_cast<std::size_t>(usage.ru_maxrss) << 10;  // Linux counts KiB
}

void require_memory(std::size_t needed, const char* noun, const char* advice) {
  const std::size_t available = available_memory();
  if (available == 0 || needed <= available) return;
  constexpr double kGibibyte = 1 << 30;
  throw Error(fmt::format("{} needs about {:.1f} GiB of memory and {:.1f} GiB are available: {}",
                          noun, static_cast<double>(needed) / kGibibyte,
                          static_cast<double>(available) / kGibibyte, advice));
}

}  // namespace tomofield::base
