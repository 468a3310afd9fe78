#include "base/system/processors.h"

#include <sched.h>
#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <fstream>
#include <vector>

#include "base/system/control_groups.h"

namespace tomofield::base {
namespace {

namespace fs = std::filesystem;

int processors_in_affinity_mask(int online) {
  // The mask of a machine with more than 1024 processors does not fit into one cpu_set_t.
  for (std::size_t sets = 1; sets <= 64; sets *= 2) {
    std::vector<cpu_set_t> mask(sets);
    const std::size_t bytes = sets * sizeof(cpu_set_t);
    if (sched_getaffinity(0, bytes, mask.data()) == 0) return CPU_COUNT_S(bytes, mask.data());
  }
  return online;
}

// Returns the quota that one group sets, in processors.
std::optional<double> quota_of_version_2(const fs::path& group) {
  std::ifstream file(group / "cpu.max");
  double quota = 0, period = 0;
  if (!(file >> quota >> period) || quota <= 0 || period <= 0) return std::nullopt;  // "max"
  return quota / period;
}

std::optional<double> quota_of_version_1(const fs::path& group) {
  std::ifstream quota_file(group / "cpu.cfs_quota_us"), period_file(group / "cpu.cfs_period_us");
  double quota = 0, period = 0;
  if (!(quota_file >> quota) || !(period_file >> period) || quota <= 0 || period <= 0)
    return std::nullopt;
  return quota / period;
}

}  // namespace

int Processors::usable() const {
  const double granted = quota ? std::ceil(*quota) : static_cast<double>(allowed);
  return std::max(1, static_cast<int>(std::min<double>(allowed, granted)));
}

Processors processors_of_this_process(const fs::path& root) {
  Processors processors;
  processors.online = std::max(1, static_cast<int>(sysconf(_SC_NPROCESSORS_ONLN)));
  processors.allowed =
      std::clamp(processors_in_affinity_mask(processors.online), 1, std::max(1, processors.online));
  processors.quota = smallest_group_limit(root, {"cpu", quota_of_version_1, quota_of_version_2});
  return processors;
}

std::optional<double> load_average(const fs::path& root) {
  std::ifstream file(root / "proc/loadavg");
  double last_minute = 0;
  if (!(file >> last_minute)) return std::nullopt;
  return last_minute;
}

}  // namespace tomofield::base
