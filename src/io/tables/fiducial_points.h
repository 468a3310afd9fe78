#pragma once

#include <filesystem>
#include <vector>

namespace tomofield::io {

/// A point of a fiducial model, in coordinates of the stack on which the model was made: pixel i
/// covers [i, i + 1), sections count from 0.
struct FiducialPoint {
  double x_px = 0.0;
  double y_px = 0.0;
  double section = 0.0;
  int line = 0;
};

/// Reads the text that IMOD's model2point writes: `x y z` on each line, or `contour x y z` (option
/// -contour), or `object contour x y z` (-object). All lines of a file have the same columns.
/// Throws Error with the file, the line and its text. `what` says in it what the points are.
std::vector<FiducialPoint> read_fiducial_points(const std::filesystem::path& path,
                                                const char* what = "fiducials");

}  // namespace tomofield::io
