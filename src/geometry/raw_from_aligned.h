#pragma once

#include <cmath>

namespace tomofield::geometry {

/// Maps an aligned pixel to its place in the raw image: p = M q + shift, where q is relative to the
/// centre of the aligned image and p to the centre of the raw one, in pixels of equal size.
struct RawFromAligned {
  double m11 = 1.0, m12 = 0.0, m21 = 0.0, m22 = 1.0;
  double shift_x_px = 0.0, shift_y_px = 0.0;

  bool is_identity() const {
    return m11 == 1.0 && m12 == 0.0 && m21 == 0.0 && m22 == 1.0 && shift_x_px == 0.0 &&
           shift_y_px == 0.0;
  }
  /// Returns the angle of the rotation that is nearest to M in least squares.
  double rotation_rad() const { return std::atan2(m21 - m12, m11 + m22); }
  /// Returns the map between the same images with pixels that are `factor` times larger.
  RawFromAligned binned(double factor) const {
    return {m11, m12, m21, m22, shift_x_px / factor, shift_y_px / factor};
  }
};

}  // namespace tomofield::geometry
