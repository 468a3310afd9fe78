#pragma once

#include <cstddef>
#include <filesystem>
#include <optional>

namespace tomofield::base {

/// The memory that this process can get, and what limits it.
struct AvailableMemory {
  std::size_t bytes = 0;             ///< can be allocated now without swapping
  bool is_limited_by_group = false;  ///< a control group grants less than the machine has
};

/// Asks the system, or returns nothing if it does not say. The machine's free memory counts, and
/// what the control groups of this process and all groups around them leave (version 2 memory.max,
/// version 1 memory.limit_in_bytes), as in a container or a batch job. `root` stands for the root
/// of the file system, so that tests can fake /proc and /sys.
std::optional<AvailableMemory> find_available_memory(const std::filesystem::path& root = "/");

/// Returns the bytes that can be allocated now without swapping, or 0 if the system does not say.
std::size_t available_memory();

/// Returns the bytes that this process has had in memory at most, or 0 if the system does not say.
std::size_t peak_memory();

/// Throws Error if `needed` bytes are more than are available: "NOUN needs about X GiB of memory
/// and Y GiB are available: ADVICE". Does nothing if the system does not say how many there are.
void require_memory(std::size_t needed, const char* noun, const char* advice,
                    const std::filesystem::path& root = "/");

}  // namespace tomofield::base
