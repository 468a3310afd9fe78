#pragma once

#include <array>
#include <span>
#include <vector>

#include "tilt_series/image.h"

namespace tomofield::alignment {

/// A view for a coarse search: line integrals in any unit, and which pixels count.
struct CoarseView {
  tilt_series::MaskedImage image;
  double tilt_deg = 0.0;
};

/// Limits of a correlation. Lengths are in pixels of the given images.
struct CorrelationOptions {
  double thickness_px = 0.0;    ///< of the specimen, roughly
  double largest_shift = 0.35;  ///< from one view to the next, as a share of the image's size
};

/// A position q of a corrected view, relative to its centre, lies in the given image at q + shift.
/// The view nearest to zero tilt has no shift.
struct CorrelationStart {
  std::vector<std::array<double, 2>> shift_px;  ///< of each view
  /// Height of each view's correlation peak above the mean, in standard deviations of the whole
  /// correlation image. Low values name views that cannot be aligned.
  std::vector<double> confidence;
};

/// Finds shifts of a few pixels' accuracy without any start.
///
/// The search goes outwards from the view nearest to zero tilt. Each view is correlated with what
/// its nearest aligned views predict of it, and then once more with its neighbours on both sides.
/// The prediction is the best linear one for a slab of the given thickness (slab_model.h): a
/// cosine-stretched mean in which a view counts at the frequencies that it shares with the wanted
/// one.
///
/// All images have one size; the tilt axis is roughly +Y through their centres. The sizes, the
/// angles and the options must have been checked.
CorrelationStart correlate_views(std::span<const CoarseView> views,
                                 const CorrelationOptions& options);

}  // namespace tomofield::alignment
