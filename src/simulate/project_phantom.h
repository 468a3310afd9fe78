#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "simulate/phantom.h"

namespace tomofield::simulate {

/// Describes a view of the parallel beam. A point (X, Y, Z), relative to the specimen's centre, is
/// seen at x = X cos θ + Z sin θ, y = Y, relative to the image's centre plus the shift. Pixel i has
/// its centre at i + 0.5. For a specimen of the other hand, give −θ.
struct ViewFrame {
  std::int64_t width = 0;
  std::int64_t height = 0;
  double tilt_deg = 0.0;
  double shift_x_px = 0.0;  ///< displacement of the specimen in the image
  double shift_y_px = 0.0;
};

/// Returns exact line integrals (density × voxels) through `bodies` at pixel centres, as an image
/// [height, width].
std::vector<double> project_ellipsoids(std::span<const Ellipsoid> bodies, const ViewFrame& view);

/// Computes exact line integrals through a phantom and its slab for rows [first_row, first_row +
/// num_rows), as [num_rows, view.width]. Rows are independent: any division into bands gives the
/// same bits.
void project_rows(const Phantom& phantom, const ViewFrame& view, std::int64_t first_row,
                  std::int64_t num_rows, std::span<float> rows);

/// Computes a whole view [height, width], bands of rows in parallel.
void project_view(const Phantom& phantom, const ViewFrame& view, std::span<float> image);

}  // namespace tomofield::simulate
