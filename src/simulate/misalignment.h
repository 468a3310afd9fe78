#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "geometry/raw_from_aligned.h"
#include "geometry/view_warp.h"

namespace tomofield::simulate {

/// Sets how the views of a simulated series are out of alignment. Spreads are the standard
/// deviations of normal random numbers, one or two for each view.
struct Misalignment {
  double shift_spread_px = 0.0;       ///< of the shifts in x and in y
  double rotation_spread_deg = 0.0;   ///< of the rotations in the plane
  double magnification_spread = 0.0;  ///< of the logarithms of the magnifications
  double axis_deg = 0.0;              ///< is added to the rotation of every view
  double local_px = 0.0;              ///< rms displacement by local motion over all views
  double tilt_spread_deg = 0.0;       ///< of the errors of the recorded tilt angles

  bool turns_or_scales() const {
    return rotation_spread_deg > 0.0 || magnification_spread > 0.0 || axis_deg != 0.0;
  }
  bool is_none() const { return shift_spread_px == 0.0 && !turns_or_scales() && local_px == 0.0; }
};

/// Returns for each view the map p = exp(m) R(φ) q + shift, where R(φ) turns counter-clockwise with
/// x to the right and y up. Its inverse is a line of an .xf file, with 7 decimals for the matrix
/// and 3 for the shift: the numbers are rounded so that the file tells the map exactly.
std::vector<geometry::RawFromAligned> draw_maps(const Misalignment& misalignment,
                                                std::uint64_t seed, std::size_t num_views);

/// Returns for each view the error of its recorded tilt angle in degrees.
std::vector<double> draw_tilt_errors(double spread_deg, std::uint64_t seed, std::size_t num_views);

/// Returns for each view a warp of an image of size × size pixels that is free of shift, rotation
/// and magnification: their least-squares fit over the view is removed. Each node follows a walk
/// over the views in which the correlation of neighbours is 0.9. All views together have the rms
/// displacement `local_px`.
std::vector<geometry::ViewWarp> draw_warps(double local_px, double size_px, std::uint64_t seed,
                                           std::size_t num_views);

}  // namespace tomofield::simulate
