#pragma once

#include <optional>
#include <vector>

#include "evaluate/image_pair.h"

namespace tomofield::verdict {

/// The direction in which the tilt axis of some views seems to lie. Sums of a view across the tilt
/// axis are the same in every view, because a tilt moves matter across the axis alone: the profile
/// along the axis is common to all views (the common line of their Fourier transforms). Profiles
/// along other directions differ.
struct AxisCheck {
  /// Direction along which profiles agree most, in degrees counter-clockwise from the y axis, from
  /// −90 to 90. It is 0 for an axis that is vertical in the views.
  double direction_deg = 0.0;
  double best = 0.0;      ///< mean correlation of the profiles along that direction
  double vertical = 0.0;  ///< the largest along directions within 5° of the y axis
  double usual = 0.0;     ///< the median over all directions
};

/// Compares the profiles of views, one image a tilt, that are 10° to 40° apart. Details between a
/// third of a view and four pixels count. Returns nothing if fewer than five pairs are that far
/// apart. AreTomo
/// determines the tilt axis by common lines, too.
std::optional<AxisCheck> check_axis(const std::vector<evaluate::Image>& views,
                                    const std::vector<double>& tilt_deg);

}  // namespace tomofield::verdict
