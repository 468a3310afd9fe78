#include "align/gauge.h"

#include <algorithm>
#include <cmath>

#include <Eigen/Cholesky>
#include <Eigen/Core>
#include <Eigen/QR>

namespace tomofield::alignment {

void remove_gauge(const geometry::TiltGeometry& geometry,
                  std::span<geometry::ViewCorrection> corrections) {
  const auto n = std::ssize(corrections);
  Eigen::MatrixX2d translation(n, 2);
  Eigen::VectorXd shifts(n);
  // A cubic in the tilt, in units of the largest, and the tilt corrections.
  Eigen::MatrixX4d cubic(n, 4);
  Eigen::VectorXd tilts(n);
  double largest_deg = 1e-3;
  for (const double tilt_deg : geometry.tilt_deg)
    largest_deg = std::max(largest_deg, std::abs(tilt_deg));
  double y = 0.0, magnification = 0.0;
  for (Eigen::Index v = 0; v < n; ++v) {
    const geometry::ViewCorrection& c = corrections[static_cast<std::size_t>(v)];
    translation.row(v) << geometry.cos_tilt(static_cast<int>(v)),
        geometry.signed_sin_tilt(static_cast<int>(v));
    shifts[v] = c.shift_x_px;
    y += c.shift_y_px / static_cast<double>(n);
    const double part = geometry.tilt_deg[static_cast<std::size_t>(v)] / largest_deg;
    cubic.row(v) << 1.0, part, part * part, part * part * part;
    tilts[v] = c.tilt_deg;
    magnification += c.log_magnification / static_cast<double>(n);
  }
  Eigen::Matrix2d normal = translation.transpose() * translation;
  normal.diagonal().array() += 1e-12 * static_cast<double>(n);  // views of one tilt have no Z
  const Eigen::Vector2d moved = normal.ldlt().solve(translation.transpose() * shifts);
  const Eigen::VectorXd smooth = cubic * cubic.colPivHouseholderQr().solve(tilts);
  for (Eigen::Index v = 0; v < n; ++v) {
    geometry::ViewCorrection& c = corrections[static_cast<std::size_t>(v)];
    c.shift_x_px -= translation.row(v) * moved;
    c.shift_y_px -= y;
    c.tilt_deg -= smooth[v];
    c.log_magnification -= magnification;
  }
}

}  // namespace tomofield::alignment
