#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "simulate/ellipsoid.h"
#include "simulate/phantom.h"

namespace tomofield::simulate {

/// One view of the parallel beam: detector pixel i has its centre at i + 0.5, and
/// a specimen point (X, Y, Z), relative to the specimen's centre, is seen at
/// x = X cos θ + Z sin θ, y = Y, relative to the image's centre plus the shift.
/// For a specimen of the other hand give −θ; for a centre at zero-based pixel
/// index c instead of (width − 1)/2 give shift_x_px = c − (width − 1)/2.
struct ViewFrame {
  std::int64_t width = 0;
  std::int64_t height = 0;
  double tilt_deg = 0.0;
  double shift_x_px = 0.0;  ///< by which the specimen is displaced in the image
  double shift_y_px = 0.0;
};

/// Exact line integrals (density × voxels) through `bodies` at pixel centres,
/// image [height, width].
std::vector<double> project_ellipsoids(std::span<const Ellipsoid> bodies, const ViewFrame& view);

/// The same for a phantom, its slab included, rows [first_row, first_row +
/// num_rows) as [num_rows, view.width] floats. Rows are independent of each
/// other: any division into bands gives the same bits.
void project_rows(const Phantom& phantom, const ViewFrame& view, std::int64_t first_row,
                  std::int64_t num_rows, std::span<float> rows);

/// A whole view, bands of rows in parallel.
void project_view(const Phantom& phantom, const ViewFrame& view, std::span<float> image);

}  // namespace tomofield::simulate
