#pragma once

#include "geometry/raw_from_aligned.h"
#include "io/tables/alignment_files.h"

namespace tomofield::geometry {

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
