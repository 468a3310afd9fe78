#pragma once

#include <array>
#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

// What a planned run says to other programs, which read it before the run (JSON).
namespace tomofield::record {

/// The sizes, needs and files of a planned run, which `reconstruct --plan FILE` writes.
struct PlanRecord {
  std::string stack = {};  ///< an absolute path
  std::int64_t num_views = 0;
  std::array<std::int64_t, 2> view_size_px{};  ///< width and height
  double pixel_size_A = 0;                     ///< of the binned views
  std::int64_t num_parameters = 0;
  int num_trials = 0;
  bool open_variation = false;   ///< nobody has given the penalty and weight of total variation
  bool open_spike_rank = false;  ///< nor the limit of spikes
  bool open_prior = false;       ///< nor the prior
  std::int64_t num_steps = 0;
  std::int64_t num_threads = 1;
  std::int64_t memory_bytes = 0;  ///< at most, with that number of threads
  std::int64_t memory_bytes_of_one_thread = 0;
  std::optional<double> core_seconds = {};  ///< processor time, if it can be estimated
  double sample_steps = 0;                  ///< the size of the run, the same on every machine
  std::int64_t result_bytes = 0;            ///< of the files that stay
  std::int64_t disk_bytes = 0;              ///< at most, while it runs
  std::vector<std::filesystem::path> inputs = {}, results = {};
  std::string relion_tomogram = {};  ///< in the row that the run writes for RELION, or empty
};

void write_plan(const std::filesystem::path& file, const PlanRecord& plan);
/// Reads what write_plan() has written. Throws Error for anything else.
PlanRecord read_plan(const std::filesystem::path& file);

/// The numbers of voxels of a volume along x, y and z of its file, and their size.
struct Grid {
  std::array<std::int64_t, 3> size{};
  double voxel_A = 0;  ///< 0 if not known; some programs write 1 then
};

/// The volume that a run is to make, and the files that it may write or remove.
struct PlannedVolume {
  Grid grid;
  std::vector<std::filesystem::path> files = {};
};

/// Writes what `--dry-run --grid FILE` does.
void write_planned_volume(const std::filesystem::path& file, const PlannedVolume& volume);
/// Reads what write_planned_volume() has written. Throws Error for anything else.
PlannedVolume read_planned_volume(const std::filesystem::path& file);

}  // namespace tomofield::record
