#include "reconstruct/axis_error.h"

#include <Eigen/Dense>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <numbers>

namespace tomofield::reconstruction {
namespace {

constexpr int kFewestShears = 8;

// What a measured view may hold beside its prediction: a part of the prediction, a constant, and
// what shifts, stretches, a rotation and a shear change in it.
constexpr int kChanges = 8, kShear = kChanges - 1;
using Changes = Eigen::Matrix<double, kChanges, 1>;

// Returns the changes of the prediction at a pixel that is not at the border.
Changes changes_at(const evaluate::Image& predicted, std::int64_t x, std::int64_t y) {
  const auto at = [&](std::int64_t i, std::int64_t j) {
    return static_cast<double>(predicted.values[static_cast<std::size_t>(j * predicted.width + i)]);
  };
  const double along_x = (at(x + 1, y) - at(x - 1, y)) / 2;
  const double along_y = (at(x, y + 1) - at(x, y - 1)) / 2;
  const double u = static_cast<double>(x) + 0.5 - static_cast<double>(predicted.width) / 2;
  const double v = static_cast<double>(y) + 0.5 - static_cast<double>(predicted.height) / 2;
  Changes changes;
  changes << at(x, y), 1.0, along_x, along_y, u * along_x, v * along_y, u * along_y - v * along_x,
      v * along_x + u * along_y;
  return changes;
}

}  // namespace

ViewShear shear_of(const evaluate::Image& measured, const evaluate::Image& predicted) {
  Eigen::Matrix<double, kChanges, kChanges> products =
      Eigen::Matrix<double, kChanges, kChanges>::Zero();
  Changes right = Changes::Zero();
  for (std::int64_t y = 1; y + 1 < predicted.height; ++y) {
    for (std::int64_t x = 1; x + 1 < predicted.width; ++x) {
      const auto i = static_cast<std::size_t>(y * predicted.width + x);
      const double difference = static_cast<double>(measured.values[i] - predicted.values[i]);
      const Changes changes = changes_at(predicted, x, y);
      if (!std::isfinite(difference) || !changes.allFinite()) continue;
      products.selfadjointView<Eigen::Lower>().rankUpdate(changes);
      right += difference * changes;
    }
  }
  const Eigen::LDLT<Eigen::MatrixXd> solver(products.selfadjointView<Eigen::Lower>());
  const Eigen::VectorXd solution = solver.solve(right);
  const double variance = solver.solve(Eigen::VectorXd::Unit(kChanges, kShear))(kShear);
  if (!solution.allFinite() || !(variance > 0)) return {};
  // Content that moves by d changes a pixel by −d · gradient.
  return {-solution(kShear), 1 / variance};
}

std::optional<AxisError> axis_error(const std::vector<ViewShear>& views,
                                    const std::vector<double>& tilt_deg) {
  const auto cosine = [&](std::size_t i) { return std::cos(tilt_deg[i] * std::numbers::pi / 180); };
  double weights = 0, mean_cosine = 0, mean_shear = 0;
  int count = 0;
  for (std::size_t i = 0; i < views.size(); ++i) {
    weights += views[i].weight;
    mean_cosine += views[i].weight * cosine(i);
    mean_shear += views[i].weight * views[i].shear;
    count += views[i].weight > 0;
  }
  if (count < kFewestShears) return std::nullopt;
  mean_cosine /= weights;
  mean_shear /= weights;
  double both = 0, squares = 0;
  for (std::size_t i = 0; i < views.size(); ++i) {
    const double c = cosine(i) - mean_cosine;
    both += views[i].weight * c * (views[i].shear - mean_shear);
    squares += views[i].weight * c * c;
  }
  if (!(squares > 1e-6 * weights)) return std::nullopt;
  const double angle = both / squares;
  double scatter = 0;
  for (std::size_t i = 0; i < views.size(); ++i) {
    const double c = cosine(i) - mean_cosine;
    scatter += std::pow(views[i].weight * c * (views[i].shear - mean_shear - angle * c), 2);
  }
  constexpr double kDegrees = 180 / std::numbers::pi;
  return AxisError{angle * kDegrees, std::sqrt(scatter) / squares * kDegrees};
}

}  // namespace tomofield::reconstruction
