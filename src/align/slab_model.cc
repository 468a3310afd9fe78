#include "align/slab_model.h"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace tomofield::align {
namespace {

constexpr double kPi = std::numbers::pi;
constexpr double kReach = 0.45;  // cycles per pixel of the image that survive the interpolation

}  // namespace

std::vector<FrequencyColumn> frequencies_below(double limit, double least_fx, std::int64_t width,
                                               std::int64_t height) {
  const auto shells_per_cycle = static_cast<double>(std::min(width, height));
  std::vector<FrequencyColumn> columns;
  for (std::int64_t kx = 1; 2 * kx <= width; ++kx) {
    FrequencyColumn column{.kx = kx, .fx = cycles_per_pixel(kx, width), .ky = {}, .shell = {}};
    if (column.fx < least_fx) continue;
    for (std::int64_t ky = 0; ky < height; ++ky) {
      const double length = std::hypot(column.fx, cycles_per_pixel(ky, height));
      if (length > limit) continue;
      column.ky.push_back(ky);
      column.shell.push_back(static_cast<int>(std::lround(length * shells_per_cycle)));
    }
    if (!column.ky.empty()) columns.push_back(std::move(column));
  }
  return columns;
}

SlabModel::SlabModel(const std::vector<FrequencyColumn>& columns, std::span<const double> tilt_deg,
                     double thickness_px)
    : columns_(columns), sigma_px_(thickness_px / std::sqrt(12.0)) {
  for (const double tilt : tilt_deg) {
    slope_.push_back(std::tan(tilt * kPi / 180.0));
    reach_.push_back(kReach * std::cos(tilt * kPi / 180.0));
  }
}

bool SlabModel::has_signal(std::size_t view, double fx) const { return fx <= reach_[view]; }

Eigen::MatrixXd SlabModel::correlation(double fx) const {
  const auto n = static_cast<Eigen::Index>(num_views());
  Eigen::MatrixXd result = Eigen::MatrixXd::Zero(n, n);
  for (std::size_t i = 0; i < num_views(); ++i)
    for (std::size_t j = 0; j < num_views(); ++j) {
      if (!has_signal(i, fx) || !has_signal(j, fx)) continue;
      const double phase = 2.0 * kPi * sigma_px_ * fx * (slope_[i] - slope_[j]);
      result(static_cast<Eigen::Index>(i), static_cast<Eigen::Index>(j)) =
          std::exp(-0.5 * phase * phase);
    }
  return result;
}

}  // namespace tomofield::align
