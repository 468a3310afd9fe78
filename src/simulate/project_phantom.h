#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "geometry/raw_from_aligned.h"
#include "geometry/view_warp.h"
#include "simulate/phantom.h"

namespace tomofield::simulate {

/// Describes a recorded view of the parallel beam. A point (X, Y, Z), relative to the specimen's
/// centre, belongs at x = X cos θ + Z sin θ, y = Y of the aligned view, relative to its centre. For
/// a specimen of the other hand, give −θ.
///
/// The recorded pixel p shows what belongs at q + d(q), where p = M q + shift is `raw_from_aligned`
/// and d the displacement of `warp`. Pixel i has its centre at i + 0.5.
struct ViewFrame {
  std::int64_t width = 0;  ///< of the recorded and of the aligned view
  std::int64_t height = 0;
  double tilt_deg = 0.0;
  geometry::RawFromAligned raw_from_aligned{};  ///< its matrix is regular
  std::optional<geometry::ViewWarp> warp{};     ///< local motion

  /// Returns true if y is constant in each recorded row.
  bool keeps_rows() const {
    const geometry::RawFromAligned& m = raw_from_aligned;
    return m.m11 == 1.0 && m.m12 == 0.0 && m.m21 == 0.0 && m.m22 == 1.0 && !warp;
  }
};

/// Returns exact line integrals (density × voxels) through `bodies` at pixel centres, as an image
/// [height, width]. The view keeps its rows.
std::vector<double> project_ellipsoids(std::span<const Ellipsoid> bodies, const ViewFrame& view);

/// Computes exact line integrals through a phantom and its slab at the pixel centres of rows
/// [first_row, first_row + num_rows), as [num_rows, view.width]. Rows are independent: any division
/// into bands gives the same bits.
void project_rows(const Phantom& phantom, const ViewFrame& view, std::int64_t first_row,
                  std::int64_t num_rows, std::span<float> rows);

/// Computes a whole view [height, width], bands of rows in parallel.
void project_view(const Phantom& phantom, const ViewFrame& view, std::span<float> image);

}  // namespace tomofield::simulate
