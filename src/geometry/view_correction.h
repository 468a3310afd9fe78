#pragma once

#include <optional>

#include "geometry/raw_from_aligned.h"
#include "geometry/view_warp.h"

namespace tomofield::geometry {

/// Describes how the alignment of a view is to be changed. A position q of the corrected aligned
/// view, relative to its centre, is found in the uncorrected one at
///
///   q' = exp(m) R(φ) q + shift,    R(φ) = [[cos φ, −sin φ], [sin φ, cos φ]]
///
/// Positions and shifts are in pixels of the view before binning. If there is local motion, q is
/// the place where it is not undone yet (ViewWarp).
struct ViewCorrection {
  double shift_x_px = 0.0, shift_y_px = 0.0;
  double rotation_rad = 0.0;        ///< φ
  double log_magnification = 0.0;   ///< m
  double tilt_deg = 0.0;            ///< is added to the tilt angle
  std::optional<ViewWarp> local{};  ///< local motion

  /// Returns the correction that makes this one first and then `next`, which refers to the view
  /// that this one corrected. Local motion of this one and a change of the rest by `next` are
  /// exchanged, which is exact to first order.
  ViewCorrection then(const ViewCorrection& next) const;
  /// Returns the same correction in pixels that are `factor` times larger.
  ViewCorrection binned(double factor) const;
  bool operator==(const ViewCorrection&) const = default;
};

/// Returns where the pixels of the corrected aligned view are in the raw image, before local motion
/// is undone.
RawFromAligned corrected(const RawFromAligned& uncorrected, const ViewCorrection& correction);

}  // namespace tomofield::geometry
