#pragma once

#include <array>
#include <string>
#include <vector>

#include "base/volume.h"
#include "evaluate/box.h"

namespace tomofield::evaluate {

/// A straight line through a volume, in voxels. Voxel i covers [i, i + 1); its centre is i + ½.
struct LineSegment {
  std::array<double, 3> from{}, to{};  ///< x, y, z
  double length() const;
  /// Returns points one voxel apart, from `from` on, as many as fit.
  std::vector<std::array<double, 3>> points() const;
};

/// Throws Error for a line that leaves the voxels or is shorter than one voxel.
void require_line_within(const LineSegment& line, const base::Box& voxels);

/// Returns the trilinear value at each point of a line. Beyond the centres of the outermost voxels,
/// the outermost values continue. `place` is where the volume lies among the voxels that the line
/// counts. Throws Error for a line that leaves the volume or is shorter than one voxel.
std::vector<double> line_profile(const base::Volume& volume, const base::Box& place,
                                 const LineSegment& line);

/// One column of a table of profiles.
struct ProfileColumn {
  std::string name;
  std::vector<double> values;
};
/// Returns a table with a line a point: its distance from the first point in Å, its place in
/// voxels, and the value of each column.
std::string profile_csv(const LineSegment& line, double voxel_size_A,
                        const std::vector<ProfileColumn>& columns);

}  // namespace tomofield::evaluate
