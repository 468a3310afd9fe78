#pragma once

#include <filesystem>
#include <functional>
#include <optional>
#include <string>

namespace tomofield::base {

/// Reads what the folder of one control group limits. Either function returns nothing if the group
/// sets no limit.
struct GroupLimit {
  using OfGroup = std::function<std::optional<double>(const std::filesystem::path& group)>;
  std::string controller;  ///< name of the controller in version 1, as in "cpu"
  OfGroup version_1, version_2;
};

/// Returns the smallest limit of the control groups of this process (both versions, cgroups(7)) and
/// of all groups around them, or nothing if none sets one. `root` stands for the root of the file
/// system, so that tests can fake /proc and /sys.
std::optional<double> smallest_group_limit(const std::filesystem::path& root,
                                           const GroupLimit& limit);

}  // namespace tomofield::base
