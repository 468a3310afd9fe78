#include "tune/lowest_loss.h"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>

namespace tomofield::tune {
namespace {

// A loss may deviate from a parabola by a part of itself, and by a little in any case.
constexpr double kPartOfLoss = 0.25, kLittle = 0.002;
// A curvature cannot be below this part of the usual one, which keeps the lowest place near.
constexpr double kLeastPart = 0.25;

double variance_of(const LossAt& at) {
  return std::pow(at.standard_error, 2) + std::pow(kPartOfLoss * at.loss, 2) + std::pow(kLittle, 2);
}

}  // namespace

double lowest_loss(std::span<const LossAt> losses, const UsualCurvature& usual) {
  const double best = std::ranges::min_element(losses, {}, &LossAt::loss)->place;
  // Weighted least squares of c0 + c1 x + c2 x², with x from the best place.
  Eigen::Matrix3d normal = Eigen::Matrix3d::Zero();
  Eigen::Vector3d right = Eigen::Vector3d::Zero();
  for (const LossAt& at : losses) {
    const double x = at.place - best;
    const Eigen::Vector3d powers(1, x, x * x);
    normal += powers * powers.transpose() / variance_of(at);
    right += powers * at.loss / variance_of(at);
  }
  normal(2, 2) += 1 / std::pow(usual.deviation, 2);
  right(2) += usual.loss_a_step / std::pow(usual.deviation, 2);
  const Eigen::Vector3d fitted = normal.completeOrthogonalDecomposition().solve(right);
  const double curvature = std::max(fitted(2), kLeastPart * usual.loss_a_step);
  const auto [first, last] = std::ranges::minmax_element(losses, {}, &LossAt::place);
  return std::clamp(best - fitted(1) / (2 * curvature), first->place, last->place);
}

}  // namespace tomofield::tune
