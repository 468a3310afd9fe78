#include "align/gauge.h"

#include <Eigen/Cholesky>
#include <Eigen/Core>

namespace tomofield::align {

void remove_gauge(const geometry::TiltGeometry& geometry,
                  std::span<geometry::ViewCorrection> corrections) {
  const auto n = std::ssize(corrections);
  Eigen::MatrixX2d translation(n, 2);
  Eigen::VectorXd shifts(n);
  double y = 0.0, tilt = 0.0, magnification = 0.0;
  for (Eigen::Index v = 0; v < n; ++v) {
    const geometry::ViewCorrection& c = corrections[static_cast<std::size_t>(v)];
    translation.row(v) << geometry.cos_tilt(static_cast<int>(v)),
        geometry.signed_sin_tilt(static_cast<int>(v));
    shifts[v] = c.shift_x_px;
    y += c.shift_y_px / static_cast<double>(n);
    tilt += c.tilt_deg / static_cast<double>(n);
    magnification += c.log_magnification / static_cast<double>(n);
  }
  Eigen::Matrix2d normal = translation.transpose() * translation;
  normal.diagonal().array() += 1e-12 * static_cast<double>(n);  // views of one tilt have no Z
  const Eigen::Vector2d moved = normal.ldlt().solve(translation.transpose() * shifts);
  for (Eigen::Index v = 0; v < n; ++v) {
    geometry::ViewCorrection& c = corrections[static_cast<std::size_t>(v)];
    c.shift_x_px -= translation.row(v) * moved;
    c.shift_y_px -= y;
    c.tilt_deg -= tilt;
    c.log_magnification -= magnification;
  }
}

}  // namespace tomofield::align
