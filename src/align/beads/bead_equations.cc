#include "align/beads/bead_equations.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include <Eigen/QR>

namespace tomofield::alignment {
namespace {

using geometry::ViewCorrection;

constexpr double kOutlier = 3.0;  // standard deviations beyond which a distance counts less

// Returns where a spot is after its view was corrected by a step.
BeadPoint moved(const BeadPoint& spot, const ViewCorrection& step) {
  const double x = spot.x_px - step.shift_x_px, y = spot.y_px - step.shift_y_px;
  const double scale = std::exp(-step.log_magnification);
  const double cosine = scale * std::cos(step.rotation_rad),
               sine = scale * std::sin(step.rotation_rad);
  return {spot.view, cosine * x + sine * y, cosine * y - sine * x};
}

}  // namespace

BeadEquations::BeadEquations(const std::vector<BeadPoint>& spots, const BeadGeometry& geometry)
    : spots_(spots),
      axis_px_(geometry.axis_px),
      place_(2 * std::ssize(spots), 3),
      weights_(2 * std::ssize(spots)) {
  const auto n = std::ssize(spots);
  place_.setZero();
  for (Eigen::Index i = 0; i < n; ++i) {
    const double tilt =
        geometry.tilt_deg[spots[static_cast<std::size_t>(i)].view] * std::numbers::pi / 180.0;
    place_.row(i) << std::cos(tilt), std::sin(tilt), 0.0;
    place_(n + i, 2) = 1.0;
  }
  weigh_equally();
}

Eigen::VectorXd BeadEquations::distances(std::span<const ViewCorrection> steps) const {
  const auto n = std::ssize(spots_);
  Eigen::VectorXd measured(2 * n);
  for (Eigen::Index i = 0; i < n; ++i) {
    const BeadPoint& spot = spots_[static_cast<std::size_t>(i)];
    const BeadPoint at = moved(spot, steps[spot.view]);
    measured[i] = at.x_px - axis_px_;
    measured[n + i] = at.y_px;
  }
  return measured - place_ * best_place(measured);
}

void BeadEquations::weigh(const Eigen::VectorXd& distances, double deviation) {
  for (Eigen::Index i = 0; i < distances.size(); ++i)
    weights_[i] = std::min(1.0, kOutlier * deviation / std::max(std::abs(distances[i]), 1e-12));
}

double BeadEquations::mean_square(const Eigen::VectorXd& distances) const {
  return weights_.dot(distances.cwiseAbs2()) / static_cast<double>(distances.size());
}

void BeadEquations::add_to(const std::vector<BeadUnknown>& unknowns, const Eigen::MatrixXd& modes,
                           std::span<const ViewCorrection> steps, Eigen::MatrixXd& normal,
                           Eigen::VectorXd& right) const {
  const Eigen::VectorXd roots = weights_.cwiseSqrt();
  const Eigen::MatrixXd columns =
      beyond_place(roots.asDiagonal() * by_unknowns(unknowns, modes, steps));
  const Eigen::VectorXd off = roots.cwiseProduct(distances(steps));
  normal += columns.transpose() * columns;
  right += columns.transpose() * off;
}

std::pair<double, double> BeadEquations::slow_part(const Eigen::MatrixXd& modes,
                                                   std::span<const ViewCorrection> steps) const {
  std::vector<BeadUnknown> shifts;
  for (const BeadUnknown::Quantity quantity : {BeadUnknown::kX, BeadUnknown::kY})
    for (Eigen::Index mode = 0; mode < modes.cols(); ++mode) shifts.push_back({quantity, mode});
  const Eigen::VectorXd roots = weights_.cwiseSqrt();
  Eigen::ColPivHouseholderQR<Eigen::MatrixXd> basis;
  basis.setThreshold(0.01);  // a place explains nearly all of some cosines
  basis.compute(beyond_place(roots.asDiagonal() * by_unknowns(shifts, modes, steps)));
  const Eigen::VectorXd off = basis.householderQ().adjoint() * roots.cwiseProduct(distances(steps));
  return {off.head(basis.rank()).squaredNorm(), static_cast<double>(basis.rank())};
}

// Returns columns, weighted, without what another place of the bead explains.
Eigen::MatrixXd BeadEquations::beyond_place(const Eigen::MatrixXd& columns) const {
  const Eigen::MatrixXd place = weights_.cwiseSqrt().asDiagonal() * place_;
  return columns - place * place.colPivHouseholderQr().solve(columns);
}

Eigen::Vector3d BeadEquations::best_place(const Eigen::VectorXd& measured) const {
  const Eigen::VectorXd roots = weights_.cwiseSqrt();
  const Eigen::MatrixXd place = roots.asDiagonal() * place_;
  return place.colPivHouseholderQr().solve(roots.cwiseProduct(measured));
}

// Returns the derivatives of the places of all spots by the unknowns.
Eigen::MatrixXd BeadEquations::by_unknowns(const std::vector<BeadUnknown>& unknowns,
                                           const Eigen::MatrixXd& modes,
                                           std::span<const ViewCorrection> steps) const {
  const auto n = std::ssize(spots_);
  Eigen::MatrixXd columns = Eigen::MatrixXd::Zero(2 * n, std::ssize(unknowns));
  for (Eigen::Index i = 0; i < n; ++i) {
    const BeadPoint& spot = spots_[static_cast<std::size_t>(i)];
    const BeadPoint at = moved(spot, steps[spot.view]);
    const double by_x[] = {1.0, 0.0, -at.y_px, at.x_px}, by_y[] = {0.0, 1.0, at.x_px, at.y_px};
    for (Eigen::Index u = 0; u < columns.cols(); ++u) {
      const auto [quantity, mode] = unknowns[static_cast<std::size_t>(u)];
      const double cosine = modes(static_cast<Eigen::Index>(spot.view), mode);
      columns(i, u) = by_x[quantity] * cosine;
      columns(n + i, u) = by_y[quantity] * cosine;
    }
  }
  return columns;
}

}  // namespace tomofield::alignment
