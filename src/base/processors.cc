#include "base/processors.h"

#include <sched.h>
#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <fstream>
#include <sstream>
#include <vector>

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

// Returns the smallest quota of a group and of all groups around it. A container sees its own group
// at the root, whatever its path outside is, so groups that do not exist are passed over.
template <typename QuotaOfGroup>
std::optional<double> smallest_quota(const fs::path& root, fs::path group,
                                     const QuotaOfGroup& quota_of) {
  std::optional<double> smallest;
  for (group = group.relative_path();; group = group.parent_path()) {
    const std::optional<double> quota = quota_of(root / group);
    if (quota) smallest = std::min(smallest.value_or(*quota), *quota);
    if (group.empty()) return smallest;
  }
}

bool lists(const std::string& controllers, const std::string& wanted) {
  std::stringstream names(controllers);
  for (std::string name; std::getline(names, name, ',');)
    if (name == wanted) return true;
  return false;
}

// Reads /proc/self/cgroup, whose lines are "number:controllers:path" (cgroups(7)). Version 2 has no
// controllers in its line.
std::optional<double> control_group_quota(const fs::path& root) {
  std::ifstream groups(root / "proc/self/cgroup");
  std::optional<double> smallest;
  for (std::string line; std::getline(groups, line);) {
    const std::size_t first = line.find(':'), second = line.find(':', first + 1);
    if (first == std::string::npos || second == std::string::npos) continue;
    const std::string controllers = line.substr(first + 1, second - first - 1);
    const fs::path path = line.substr(second + 1);
    std::optional<double> quota;
    if (controllers.empty())
      quota = smallest_quota(root / "sys/fs/cgroup", path, quota_of_version_2);
    else if (lists(controllers, "cpu"))
      quota = smallest_quota(root / "sys/fs/cgroup/cpu", path, quota_of_version_1);
    if (quota) smallest = std::min(smallest.value_or(*quota), *quota);
  }
  return smallest;
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
  processors.quota = control_group_quota(root);
  return processors;
}

std::optional<double> load_average(const fs::path& root) {
  std::ifstream file(root / "proc/loadavg");
  double last_minute = 0;
  if (!(file >> last_minute)) return std::nullopt;
  return last_minute;
}

}  // namespace tomofield::base
