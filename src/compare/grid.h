#pragma once

#include <filesystem>
#include <string>

#include "record/plan_record.h"

namespace tomofield::compare {

using record::Grid;

/// Reads the grid from the header of an MRC volume.
Grid read_grid(const std::filesystem::path& mrc);

/// The grid of a volume and the name of its maker.
struct NamedGrid {
  std::string name;
  Grid grid;
};

/// Throws Error, with both names and grids, unless the voxels of both coincide.
void require_one_grid(const NamedGrid& main, const NamedGrid& other);

/// Throws Error if a volume cannot be scored against the truth: voxels of another size, axes in
/// another order, or less than half of one in the other along an axis. The last does not matter for
/// a volume that `is_a_part`, which its ORIGIN places (evaluate::read_pair).
void require_truth_fits(const std::filesystem::path& truth, const NamedGrid& main, bool is_a_part);

}  // namespace tomofield::compare
