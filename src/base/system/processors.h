#pragma once

#include <filesystem>
#include <optional>
#include <string>

namespace tomofield::base {

/// The part of a machine's processors that this process may use.
struct Processors {
  int online = 1;               ///< processors of the machine
  int allowed = 1;              ///< of these, the ones in the process's affinity mask
  std::optional<double> quota;  ///< processors' worth of time that a control group grants

  /// Returns the number of threads that can run at once, at least 1.
  int usable() const;
  /// Returns true if nothing keeps the process from using the whole machine.
  bool are_all_usable() const { return allowed == online && !quota; }
};

/// Asks the system. `root` stands for the root of the file system, so that tests can fake /proc and
/// /sys: control groups of version 1 (cpu.cfs_quota_us) and 2 (cpu.max), in the group of this
/// process and in all groups around it.
Processors processors_of_this_process(const std::filesystem::path& root = "/");

/// Returns the load average of the last minute, or nothing if the system does not say. It counts
/// the threads of all processes that ran or were ready to run.
std::optional<double> load_average(const std::filesystem::path& root = "/");

}  // namespace tomofield::base
