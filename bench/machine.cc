#include "bench/machine.h"

#include <array>
#include <cstdio>
#include <fstream>
#include <memory>

namespace tomofield::bench {

std::string cpu_model() {
  std::ifstream cpuinfo("/proc/cpuinfo");
  for (std::string line; std::getline(cpuinfo, line);) {
    if (line.starts_with("model name")) return line.substr(line.find(':') + 2);
  }
  return {};
}

std::string source_commit() {
  const std::unique_ptr<FILE, int (*)(FILE*)> git(
      popen("git -C '" TOMOFIELD_SOURCE_DIR "' describe --always --dirty 2>/dev/null", "r"),
      pclose);
  std::array<char, 64> line{};
  if (!git || std::fgets(line.data(), line.size(), git.get()) == nullptr) return {};
  const std::string commit(line.data());
  return commit.substr(0, commit.find('\n'));
}

}  // namespace tomofield::bench
