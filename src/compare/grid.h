#pragma once

#include <array>
#include <cstdint>
#include <filesystem>
#include <string>

namespace tomofield::compare {

/// Voxels of a volume along x, y and z of its file, and how large they are.
struct Grid {
  std::array<std::int64_t, 3> size{};
  double voxel_A = 0;  ///< 0, or 1 as some programs write it: not known
};

/// By the header of an MRC volume.
Grid read_grid(const std::filesystem::path& mrc);

/// By what a command that reconstructs says under --dry-run (cli::print_sizes): voxel sizes to four
/// digits.
Grid planned_grid(const std::string& said);

/// A volume and who makes it.
struct NamedGrid {
  std::string name;
  Grid grid;
};

/// Throws Error, with both names and grids, unless voxel lies on voxel.
void require_one_grid(const NamedGrid& main, const NamedGrid& other);

/// Throws Error if a volume could not be scored against the truth: voxels of another size, axes in
/// another order, or less than half of one in the other along an axis, unless the volume
/// `is_a_part` that its ORIGIN places (evaluate::read_pair).
void require_truth_fits(const std::filesystem::path& truth, const NamedGrid& main, bool is_a_part);

}  // namespace tomofield::compare
