#pragma once

namespace tomofield::geometry {

/// Where an aligned pixel comes from in the raw image: with q relative to the
/// centre of the aligned image and p relative to the centre of the raw one, in
/// pixels of equal size, p = M q + shift.
struct RawFromAligned {
  double m11 = 1.0, m12 = 0.0, m21 = 0.0, m22 = 1.0;
  double shift_x_px = 0.0, shift_y_px = 0.0;

  bool is_identity() const {
    return m11 == 1.0 && m12 == 0.0 && m21 == 0.0 && m22 == 1.0 && shift_x_px == 0.0 &&
           shift_y_px == 0.0;
  }
  /// The same between images whose pixels are `factor` times larger.
  RawFromAligned binned(double factor) const {
    return {m11, m12, m21, m22, shift_x_px / factor, shift_y_px / factor};
  }
};

}  // namespace tomofield::geometry
