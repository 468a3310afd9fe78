#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "microscope/view_transfer.h"
#include "tilt_series/image.h"

namespace tomofield::tilt_series {

/// A solid sphere of density 1, by its place in a view.
struct Sphere {
  double x_px = 0.0, y_px = 0.0;  ///< pixel i covers [i, i + 1)
  double radius_px = 0.0;

  /// Returns the distance of the centre of a pixel from the middle.
  double distance(std::int64_t x, std::int64_t y) const {
    return std::hypot(static_cast<double>(x) + 0.5 - x_px, static_cast<double>(y) + 0.5 - y_px);
  }
};

/// The image of a sphere after a contrast transfer, in a square window of the view. The window may
/// reach beyond the view.
struct BeadFringes {
  Sphere sphere;
  double outer_px = 0.0;  ///< they end within this distance from the middle
  std::int64_t x0 = 0, y0 = 0, size = 0;
  std::vector<float> values;      ///< [y, x] of the window
  std::vector<float> by_x, by_y;  ///< their derivatives by the place of the sphere, a pixel
  std::vector<float> by_radius;   ///< and by the logarithm of its radius

  /// Calls body(index in the view, index in the window, x, y) for the pixels of the window that
  /// lie in the view.
  template <typename Body>
  void for_pixels(const MaskedImage& view, const Body& body) const {
    const std::int64_t x_end = std::min(x0 + size, view.width),
                       y_end = std::min(y0 + size, view.height);
    for (std::int64_t y = std::max<std::int64_t>(y0, 0); y < y_end; ++y)
      for (std::int64_t x = std::max<std::int64_t>(x0, 0); x < x_end; ++x)
        body(view.index(x, y), static_cast<std::size_t>((y - y0) * size + x - x0), x, y);
  }
};

/// Returns the fringes of a sphere in a view of this size, by the defocus at its place.
BeadFringes fringes_of(const Sphere& sphere, const microscope::ViewTransfer& transfer,
                       std::int64_t width, std::int64_t height);

}  // namespace tomofield::tilt_series
