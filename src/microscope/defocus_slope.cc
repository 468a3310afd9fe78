#include "microscope/defocus_slope.h"

#include <cmath>
#include <numbers>

#include "geometry/imod_transform.h"

namespace tomofield::microscope {

DefocusSlope slope_of_tilt(double tilt_deg, double pixel_size_A, DefocusHand hand,
                           const geometry::RawFromAligned& map) {
  const double per_pixel_A =
      static_cast<double>(hand) * pixel_size_A * std::tan(tilt_deg * std::numbers::pi / 180.0);
  const io::ImodTransform aligned = geometry::invert(map);
  return {per_pixel_A * aligned.shift_x_px, per_pixel_A * aligned.a11, per_pixel_A * aligned.a12};
}

}  // namespace tomofield::microscope
