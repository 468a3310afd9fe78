#include "base/system/memory.h"

#include <fmt/core.h>

#include <algorithm>
#include <fstream>
#include <string>

#include "base/system/control_groups.h"
#include "tomofield/error.h"

namespace tomofield::base {

namespace {

namespace fs = std::filesystem;

// Returns the number of a line "KEY number …" of a file of the system, or nothing if there is none.
std::optional<double> number_after(const fs::path& path, const std::string& key) {
  std::ifstream file(path);
  double value = 0;
  for (std::string word; file >> word;)
    if (word == key && file >> value) return value;
  return std::nullopt;
}

std::optional<double> number_in(const fs::path& path) {
  std::ifstream file(path);
  double value = 0;
  if (!(file >> value)) return std::nullopt;  // "max", or no such file
  return value;
}

// Returns the bytes of a line "KEY: n kB" of a file in /proc, or nothing if there is none.
std::optional<double> bytes_in(const fs::path& path, const std::string& key) {
  const auto kibibytes = number_after(path, key);
  return kibibytes ? std::optional(*kibibytes * 1024) : std::nullopt;
}

// Returns what a group leaves of its limit. Cached files make room when it is needed.
double left_of(double limit, const fs::path& group, const char* usage, const char* cached_prefix) {
  double used = number_in(group / usage).value_or(0);
  for (const char* files : {"inactive_file", "active_file"})
    used -= number_after(group / "memory.stat", std::string(cached_prefix) + files).value_or(0);
  return std::max(limit - std::max(used, 0.0), 0.0);
}

std::optional<double> left_of_version_2(const fs::path& group) {
  const auto limit = number_in(group / "memory.max");
  if (!limit) return std::nullopt;
  return left_of(*limit, group, "memory.current", "");
}

// A group without a limit has one of about 2^63.
std::optional<double> left_of_version_1(const fs::path& group) {
  const auto limit = number_in(group / "memory.limit_in_bytes");
  if (!limit) return std::nullopt;
  return left_of(*limit, group, "memory.usage_in_bytes", "total_");
}

}  // namespace

std::optional<AvailableMemory> find_available_memory(const fs::path& root) {
  const auto of_machine = bytes_in(root / "proc/meminfo", "MemAvailable:");
  const auto of_group =
      smallest_group_limit(root, {"memory", left_of_version_1, left_of_version_2});
  if (!of_machine && !of_group) return std::nullopt;
  const bool is_limited = of_group && (!of_machine || *of_group < *of_machine);
  return AvailableMemory{static_cast<std::size_t>(is_limited ? *of_group : *of_machine),
                         is_limited};
}

std::size_t available_memory() {
  const auto found = find_available_memory();
  return found ? std::max<std::size_t>(found->bytes, 1) : 0;
}

std::size_t peak_memory() {
  return static_cast<std::size_t>(bytes_in("/proc/self/status", "VmHWM:").value_or(0));
}

void require_memory(std::size_t needed, const char* noun, const char* advice,
                    const fs::path& root) {
  const auto available = find_available_memory(root);
  if (!available || needed <= available->bytes) return;
  constexpr double kGibibyte = 1 << 30;
  throw Error(fmt::format(
      "{} needs about {:.1f} GiB of memory and {:.1f} GiB are available{}: {}", noun,
      static_cast<double>(needed) / kGibibyte, static_cast<double>(available->bytes) / kGibibyte,
      available->is_limited_by_group ? ", since the control group of this job or container grants "
                                       "no more"
                                     : "",
      advice));
}

}  // namespace tomofield::base
