#include "base/system/control_groups.h"

#include <algorithm>
#include <fstream>
#include <sstream>

namespace tomofield::base {
namespace {

namespace fs = std::filesystem;

// Returns the smallest limit of a group and of all groups around it. A container sees its own group
// at the root, whatever its path outside is, so groups that do not exist are passed over.
std::optional<double> smallest_around(const fs::path& root, fs::path group,
                                      const GroupLimit::OfGroup& limit_of) {
  std::optional<double> smallest;
  for (group = group.relative_path();; group = group.parent_path()) {
    const std::optional<double> limit = limit_of(root / group);
    if (limit) smallest = std::min(smallest.value_or(*limit), *limit);
    if (group.empty()) return smallest;
  }
}

bool lists(const std::string& controllers, const std::string& wanted) {
  std::stringstream names(controllers);
  for (std::string name; std::getline(names, name, ',');)
    if (name == wanted) return true;
  return false;
}

}  // namespace

std::optional<double> smallest_group_limit(const fs::path& root, const GroupLimit& limit) {
  // The lines of this file are "number:controllers:path". Version 2 has no controllers in its line.
  std::ifstream groups(root / "proc/self/cgroup");
  std::optional<double> smallest;
  for (std::string line; std::getline(groups, line);) {
    const std::size_t first = line.find(':'), second = line.find(':', first + 1);
    if (first == std::string::npos || second == std::string::npos) continue;
    const std::string controllers = line.substr(first + 1, second - first - 1);
    const fs::path path = line.substr(second + 1);
    const fs::path mount = root / "sys/fs/cgroup";
    std::optional<double> found;
    if (controllers.empty())
      found = smallest_around(mount, path, limit.version_2);
    else if (lists(controllers, limit.controller))
      found = smallest_around(mount / limit.controller, path, limit.version_1);
    if (found) smallest = std::min(smallest.value_or(*found), *found);
  }
  return smallest;
}

}  // namespace tomofield::base
