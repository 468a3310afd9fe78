#include "geometry/view_correction.h"

#include <array>
#include <cmath>

namespace tomofield::geometry {
namespace {

// Returns exp(m) R(φ), by rows.
std::array<double, 4> matrix_of(const ViewCorrection& c) {
  const double scale = std::exp(c.log_magnification);
  const double cosine = scale * std::cos(c.rotation_rad), sine = scale * std::sin(c.rotation_rad);
  return {cosine, -sine, sine, cosine};
}

std::optional<ViewWarp> motion_of_both(const std::optional<ViewWarp>& first,
                                       const std::optional<ViewWarp>& next) {
  if (first && next) return first->then(*next);
  return first ? first : next;
}

}  // namespace

ViewCorrection ViewCorrection::then(const ViewCorrection& next) const {
  const auto m = matrix_of(*this);
  return {.shift_x_px = m[0] * next.shift_x_px + m[1] * next.shift_y_px + shift_x_px,
          .shift_y_px = m[2] * next.shift_x_px + m[3] * next.shift_y_px + shift_y_px,
          .rotation_rad = rotation_rad + next.rotation_rad,
          .log_magnification = log_magnification + next.log_magnification,
          .tilt_deg = tilt_deg + next.tilt_deg,
          .local = motion_of_both(local, next.local)};
}

ViewCorrection ViewCorrection::binned(double factor) const {
  ViewCorrection result = *this;
  result.shift_x_px /= factor;
  result.shift_y_px /= factor;
  if (local) result.local = local->binned(factor);
  return result;
}

RawFromAligned corrected(const RawFromAligned& uncorrected, const ViewCorrection& correction) {
  const RawFromAligned& a = uncorrected;
  const auto m = matrix_of(correction);
  return {
      .m11 = a.m11 * m[0] + a.m12 * m[2],
      .m12 = a.m11 * m[1] + a.m12 * m[3],
      .m21 = a.m21 * m[0] + a.m22 * m[2],
      .m22 = a.m21 * m[1] + a.m22 * m[3],
      .shift_x_px = a.m11 * correction.shift_x_px + a.m12 * correction.shift_y_px + a.shift_x_px,
      .shift_y_px = a.m21 * correction.shift_x_px + a.m22 * correction.shift_y_px + a.shift_y_px};
}

}  // namespace tomofield::geometry
