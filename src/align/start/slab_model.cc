#include "align/start/slab_model.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <numbers>

namespace tomofield::alignment {
namespace {

constexpr double kPi = std::numbers::pi;
constexpr double kReach = 0.45;  // cycles per pixel of the image that survive the interpolation

}  // namespace

SlabModel::SlabModel(std::span<const double> tilt_deg, double thickness_px)
    : sigma_px_(thickness_px / std::sqrt(12.0)) {
  for (const double tilt : tilt_deg) {
    slope_.push_back(std::tan(tilt * kPi / 180.0));
    reach_.push_back(kReach * std::cos(tilt * kPi / 180.0));
  }
}

Eigen::MatrixXd SlabModel::correlation(double fx) const {
  const std::ptrdiff_t n = std::ssize(slope_);
  Eigen::MatrixXd result = Eigen::MatrixXd::Zero(n, n);
  for (std::ptrdiff_t i = 0; i < n; ++i)
    for (std::ptrdiff_t j = 0; j < n; ++j) {
      const auto a = static_cast<std::size_t>(i), b = static_cast<std::size_t>(j);
      if (fx > std::min(reach_[a], reach_[b])) continue;
      const double phase = 2.0 * kPi * sigma_px_ * fx * (slope_[a] - slope_[b]);
      result(i, j) = std::exp(-0.5 * phase * phase);
    }
  return result;
}

}  // namespace tomofield::alignment
