#pragma once

#include "geometry/raw_from_aligned.h"

namespace tomofield::microscope {

/// Describes how the underfocus changes over an image: what is added to that of the view at a pixel
/// (x, y), relative to the image's centre, is at_centre_A + x_A x + y_A y.
struct DefocusSlope {
  double at_centre_A = 0.0;
  double x_A = 0.0, y_A = 0.0;  ///< per pixel

  double at(double x_px, double y_px) const { return at_centre_A + x_A * x_px + y_A * y_px; }
};

/// The side of a tilted view that is farther from focus. The geometry of tomofield says that it is
/// the right side at a positive tilt, as IMOD has it; data of the other hand have the left one.
enum class DefocusHand { kRight = 1, kLeft = -1 };

/// Returns the slope of a view that shows the plane Z = 0 of the specimen. The defocus of the view
/// is that on the tilt axis, x = 0 of the aligned view. Z points to the source, and a point of the
/// specimen at height −X sin θ + Z cos θ is nearer to focus by its height: so underfocus grows by
/// x tan θ. The image is the aligned one, or that of which `map` is the place of aligned pixels.
DefocusSlope slope_of_tilt(double tilt_deg, double pixel_size_A, DefocusHand hand,
                           const geometry::RawFromAligned& map = {});

}  // namespace tomofield::microscope
