#pragma once

#include <array>
#include <string>
#include <vector>

#include "base/volume.h"
#include "evaluate/box.h"

namespace tomofield::evaluate {

/// A straight line through a volume, in voxels: voxel i covers [i, i + 1), its
/// centre is i + ½.
struct LineSegment {
  std::array<double, 3> from{}, to{};  ///< x, y, z
  double length() const;
  /// One voxel apart, from `from` on, and as many as fit.
  std::vector<std::array<double, 3>> points() const;
};

/// Trilinear value at each point of a line; beyond the centres of the outermost voxels these
/// go on. `place` is where the volume lies among the voxels that the line counts. Throws
/// Error for a line that leaves the volume or is shorter than one voxel.
std::vector<double> line_profile(const base::Volume& volume, const Box& place,
                                 const LineSegment& line);

/// One column of a table of profiles.
struct ProfileColumn {
  std::string name;
  std::vector<double> values;
};
/// A line a point: its distance from the first in Å, its place in voxels, and each column.
std::string profile_csv(const LineSegment& line, double voxel_size_A,
                        const std::vector<ProfileColumn>& columns);

}  // namespace tomofield::evaluate
