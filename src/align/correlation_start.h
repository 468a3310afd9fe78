#pragma once

#include <array>
#include <span>
#include <vector>

#include "tilt_series/image.h"

namespace tomofield::align {

/// Holds a view for a coarse search: line integrals in any unit, and which pixels count.
struct CoarseView {
  tilt_series::MaskedImage image;
  double tilt_deg = 0.0;
};

struct CorrelationOptions {
  double thickness_px = 0.0;        ///< of the specimen
  double largest_shift = 0.25;      ///< from one view to the next, as a share of the width
  double axis_range_deg = 6.0;      ///< the axis is looked for within ± this; 0: it is known
};

/// Holds what a correlation finds. A position q of a corrected view, relative to its centre, lies
/// in the given image at R(axis) q + shift, with R(φ) = [[cos φ, −sin φ], [sin φ, cos φ]].
struct CorrelationStart {
  double axis_deg = 0.0;
  std::vector<std::array<double, 2>> shift_px;
  std::vector<double> confidence;
};

CorrelationStart correlate_views(std::span<const CoarseView> views,
                                 const CorrelationOptions& options);

}  // namespace tomofield::align
