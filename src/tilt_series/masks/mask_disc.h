#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>

namespace tomofield::tilt_series {

/// A round part of a view that hides a bead or a fiducial.
struct MaskDisc {
  double x_px = 0.0;  ///< pixel i covers [i, i + 1)
  double y_px = 0.0;
  double radius_px = 0.0;
};

/// Calls body(x, y) for each pixel of an image of width × height pixels whose centre lies in the
/// disc.
template <typename Body>
void for_pixels_in(const MaskDisc& disc, std::int64_t width, std::int64_t height,
                   const Body& body) {
  const auto low = [&](double at) {
    return std::max<std::int64_t>(static_cast<std::int64_t>(std::floor(at - disc.radius_px)), 0);
  };
  const auto high = [&](double at, std::int64_t size) {
    return std::min(static_cast<std::int64_t>(std::ceil(at + disc.radius_px)), size);
  };
  for (std::int64_t y = low(disc.y_px); y < high(disc.y_px, height); ++y) {
    for (std::int64_t x = low(disc.x_px); x < high(disc.x_px, width); ++x) {
      const double distance = std::hypot(static_cast<double>(x) + 0.5 - disc.x_px,
                                         static_cast<double>(y) + 0.5 - disc.y_px);
      if (distance <= disc.radius_px) body(x, y);
    }
  }
}

}  // namespace tomofield::tilt_series
