#pragma once

#include <cmath>

#include "io/tables/alignment_files.h"

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
  /// Returns the map for places that count from a point which lies `x_px` to the right of the
  /// centre of the aligned image, such as the tilt axis.
  RawFromAligned counted_from(double x_px) const {
    return {m11, m12, m21, m22, shift_x_px + m11 * x_px, shift_y_px + m21 * x_px};
  }
  /// Returns the map between the same images with pixels that are `factor` times larger.
  RawFromAligned binned(double factor) const {
    return {m11, m12, m21, m22, shift_x_px / factor, shift_y_px / factor};
  }
};

/// Returns the inverse of a line of an .xf file, whose matrix must be regular.
inline RawFromAligned invert(const io::ImodTransform& t) {
  const double determinant = t.a11 * t.a22 - t.a12 * t.a21;
  RawFromAligned inverse;
  inverse.m11 = t.a22 / determinant;
  inverse.m12 = -t.a12 / determinant;
  inverse.m21 = -t.a21 / determinant;
  inverse.m22 = t.a11 / determinant;
  inverse.shift_x_px = -(inverse.m11 * t.shift_x_px + inverse.m12 * t.shift_y_px);
  inverse.shift_y_px = -(inverse.m21 * t.shift_x_px + inverse.m22 * t.shift_y_px);
  return inverse;
}

/// Returns the line of an .xf file that undoes `map`, whose matrix must be regular.
inline io::ImodTransform invert(const RawFromAligned& map) {
  const RawFromAligned inverse =
      invert(io::ImodTransform{map.m11, map.m12, map.m21, map.m22, map.shift_x_px, map.shift_y_px});
  return {inverse.m11, inverse.m12,        inverse.m21,
          inverse.m22, inverse.shift_x_px, inverse.shift_y_px};
}

}  // namespace tomofield::geometry
