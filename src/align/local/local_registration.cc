#include "align/local/local_registration.h"

#include <algorithm>
#include <cmath>

#include <Eigen/Cholesky>

#include "base/statistics.h"

namespace tomofield::alignment {
namespace {

constexpr double kFewestSamples = 20;  // fewer do not tell scale, trend and an affine motion

}  // namespace

using geometry::ViewWarp;

void LocalRegistration::add(std::size_t set, double x, const Pixel& pixel, double weight) {
  const ViewWarp::Weights across = ViewWarp::node_weights(x / frame_.width_px);
  const double part = 2 * x / frame_.width_px;
  Eigen::Matrix<double, kRowColumns, 1> columns;
  for (int node = 0; node < kNodes; ++node) {
    columns[2 * node] = across[static_cast<std::size_t>(node)] * pixel.by_x;
    columns[2 * node + 1] = across[static_cast<std::size_t>(node)] * pixel.by_y;
  }
  columns.tail<5>() << pixel.predicted, 1.0, part, part * part, pixel.measured;
  sets_[set].row.selfadjointView<Eigen::Lower>().rankUpdate(columns, weight);
  sets_[set].num_pixels += 1.0;
}

void LocalRegistration::end_row(double y) {
  const ViewWarp::Weights along = ViewWarp::node_weights(y / frame_.height_px);
  const double part = 2 * y / frame_.height_px;
  Eigen::Matrix<double, kColumns, kRowColumns> spread;
  spread.setZero();
  for (int row = 0; row < kNodes; ++row)
    for (int column = 0; column < kRowScale; ++column)
      spread(row * kRowScale + column, column) = along[static_cast<std::size_t>(row)];
  // Scale; then 1, x, y, x², xy and y²; then the measurement.
  spread(kMotion, kRowScale) = 1.0;
  spread(kMotion + 1, kRowScale + 1) = 1.0;
  spread(kMotion + 2, kRowScale + 2) = 1.0;
  spread(kMotion + 3, kRowScale + 1) = part;
  spread(kMotion + 4, kRowScale + 3) = 1.0;
  spread(kMotion + 5, kRowScale + 2) = part;
  spread(kMotion + 6, kRowScale + 1) = part * part;
  spread(kUnknown, kRowScale + 4) = 1.0;
  for (Set& set : sets_) {
    const RowSums row = set.row.selfadjointView<Eigen::Lower>();
    set.sums.noalias() += spread * (row * spread.transpose());
    set.row.setZero();
  }
}

// Returns the columns of an affine motion, of the scale and of the trend in terms of all columns.
Eigen::MatrixXd LocalRegistration::affine_columns() const {
  Eigen::MatrixXd columns = Eigen::MatrixXd::Zero(kUnknown, 6 + kUnknown - kMotion);
  for (int row = 0; row < kNodes; ++row) {
    for (int column = 0; column < kNodes; ++column) {
      const int at = 2 * (row * kNodes + column);
      const ViewWarp::Vector place = frame_.node_place(row, column);
      for (int axis = 0; axis < 2; ++axis)
        columns.block<1, 3>(at + axis, 3 * axis) << 1.0, place[0] / frame_.width_px,
            place[1] / frame_.width_px;
    }
  }
  columns.bottomRightCorner<kUnknown - kMotion, kUnknown - kMotion>().setIdentity();
  return columns;
}

Eigen::VectorXd LocalRegistration::solve_affine(const Sums& sums) const {
  const Eigen::MatrixXd columns = affine_columns();
  const Eigen::MatrixXd normal =
      columns.transpose() * sums.topLeftCorner<kUnknown, kUnknown>() * columns;
  const Eigen::VectorXd right = columns.transpose() * sums.col(kUnknown).head<kUnknown>();
  return columns * normal.ldlt().solve(right);
}

// Returns the motion times the scale, the scale and the trend. `ridge_px2` is what a displacement
// of a node adds to the squares.
Eigen::VectorXd LocalRegistration::solve_on(const Sums& sums, const Eigen::VectorXd& known,
                                            double ridge_px2) const {
  Eigen::MatrixXd normal = sums.topLeftCorner<kUnknown, kUnknown>();
  Eigen::VectorXd right = sums.col(kUnknown).head<kUnknown>();
  const double scale = solve_affine(sums)[kMotion];
  const double ridge = ridge_px2 / std::max(scale * scale, 1e-30);
  normal.diagonal().head<kMotion>().array() += ridge;
  right.head<kMotion>() -= ridge * scale * known;
  normal.diagonal() *= 1.0 + 1e-9;
  normal.diagonal().array() += 1e-30;
  return normal.ldlt().solve(right);
}

double LocalRegistration::squared_residual(const Sums& sums, const Eigen::VectorXd& solution) {
  return sums(kUnknown, kUnknown) - 2 * solution.dot(sums.col(kUnknown).head<kUnknown>()) +
         solution.dot(sums.topLeftCorner<kUnknown, kUnknown>() * solution);
}

// Returns the variance of the noise of an independent sample over that of a displacement.
double LocalRegistration::ridge() const {
  const double variance = squared_residual(all(), solve_affine(all())) / num_pixels();
  const double prior = options_.prior_px / options_.pixel;
  return std::max(variance, 0.0) * options_.pixels_per_sample / (prior * prior);
}

double LocalRegistration::gain() const {
  if (sets_[0].num_pixels == 0.0 || sets_[1].num_pixels == 0.0) return 0.0;
  const Eigen::VectorXd none = Eigen::VectorXd::Zero(kMotion);
  const double ridge_px2 = ridge();
  double without = 0.0, with = 0.0;
  for (std::size_t set = 0; set < 2; ++set) {
    const Sums& deciding = sets_[set].sums;
    const Sums& judging = sets_[1 - set].sums;
    without += squared_residual(judging, solve_affine(deciding));
    with += squared_residual(judging, solve_on(deciding, none, ridge_px2));
  }
  return without > 0.0 ? 1.0 - with / without : 0.0;
}

ViewWarp LocalRegistration::solve(const ViewWarp& known) const {
  ViewWarp motion = frame_;
  motion.nodes = {};
  if (num_pixels() >= kFewestSamples * options_.pixels_per_sample) {
    Eigen::VectorXd known_px(kMotion);
    for (std::size_t i = 0; i < kMotion; ++i)
      known_px[static_cast<Eigen::Index>(i)] = known.nodes[i / 2][i % 2] / options_.pixel;
    const Eigen::VectorXd solution = solve_on(all(), known_px, ridge());
    const double scale = solution[kMotion];
    for (std::size_t i = 0; i < kMotion && scale > 0.0; ++i)
      motion.nodes[i / 2][i % 2] = solution[static_cast<Eigen::Index>(i)] / scale;
  }
  return motion.binned(1.0 / options_.pixel);
}

std::vector<ViewWarp> motion_that_pays(std::span<const LocalRegistration> views) {
  constexpr double kSure = 3.0;  // standard errors
  std::vector<double> gains;
  for (const LocalRegistration& view : views) gains.push_back(view.gain());
  std::vector<ViewWarp> motion;
  if (!base::mean_gain(gains).exceeds(kSure)) return motion;
  for (const LocalRegistration& view : views) motion.push_back(view.solve({}));
  return motion;
}

}  // namespace tomofield::alignment
