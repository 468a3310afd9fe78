#pragma once

#include <filesystem>
#include <vector>

namespace tomofield::io {

/// A point of a fiducial model, in the coordinates of the stack that the model
/// was made on: pixel i covers [i, i + 1), sections count from 0.
struct FiducialPoint {
  double x_px = 0.0;
  double y_px = 0.0;
  double section = 0.0;
  int line = 0;
};

/// The text that IMOD's model2point writes: `x y z` a line, or `contour x y z`
/// (its option -contour), or `object contour x y z` (-object); all lines of a
/// file have the same columns. Throws Error with the file, the line and its text.
std::vector<FiducialPoint> read_fiducial_points(const std::filesystem::path& path);

}  // namespace tomofield::io
