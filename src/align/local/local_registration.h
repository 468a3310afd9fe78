#pragma once

#include <array>
#include <cstddef>
#include <span>
#include <vector>

#include <Eigen/Core>

#include "geometry/view_warp.h"

namespace tomofield::alignment {

/// Lengths and weights of the registration of local motion.
struct LocalRegistrationOptions {
  geometry::ViewWarp frame;        ///< has the size of the aligned view, before binning
  double pixel = 1.0;              ///< size of a pixel of the stage, in pixels before binning
  double prior_px = 1.0;           ///< expected standard deviation of a node along x or y
  double pixels_per_sample = 1.0;  ///< pixels of the stage that are one independent sample
};

/// Describes local motion between a view and its prediction to first order, as least squares
///
///   b ≈ a p + a (∂p/∂x, ∂p/∂y) · Σ weight_n e_n + a quadratic trend
///
/// over the nodes n of a ViewWarp: the view shows at q what the prediction has at q + e(q). The
/// pixels belong to two sets, and each set tells how well the solution of the other one predicts
/// it.
class LocalRegistration {
 public:
  explicit LocalRegistration(const LocalRegistrationOptions& options)
      : options_(options), frame_(options.frame.binned(options.pixel)) {}

  /// Describes a pixel: derivatives and value of the prediction, and the measurement.
  struct Pixel {
    double by_x, by_y, predicted, measured;
  };
  /// Adds a pixel of the present row to one of the sets (0 or 1). Positions are in pixels of the
  /// stage, relative to the centre of the aligned view.
  void add(std::size_t set, double x, const Pixel& pixel, double weight);
  /// Ends the row of pixels at y.
  void end_row(double y);

  /// Returns how much smaller the error of pixels that did not decide becomes if there is motion
  /// beyond an affine one: a part of the error with an affine one.
  double gain() const;

  /// Returns the motion e that is to be added to `known`, in pixels before binning. The prior is on
  /// the sum of both.
  geometry::ViewWarp solve(const geometry::ViewWarp& known) const;

 private:
  static constexpr int kNodes = geometry::ViewWarp::kNodes;
  static constexpr int kMotion = 2 * kNodes * kNodes;  // columns of the motion
  static constexpr int kUnknown = kMotion + 7;         // scale and trend follow
  static constexpr int kColumns = kUnknown + 1;        // the measurement is the last
  // Columns of a row of pixels, in which y is the same: gradients by nodes in x, scale, 1, x, x²,
  // b.
  static constexpr int kRowScale = 2 * kNodes, kRowColumns = kRowScale + 5;

  using Sums = Eigen::Matrix<double, kColumns, kColumns>;
  using RowSums = Eigen::Matrix<double, kRowColumns, kRowColumns>;

  struct Set {
    Sums sums = Sums::Zero();
    RowSums row = RowSums::Zero();
    double num_pixels = 0.0;
  };
  Eigen::MatrixXd affine_columns() const;
  Eigen::VectorXd solve_affine(const Sums& sums) const;
  Eigen::VectorXd solve_on(const Sums& sums, const Eigen::VectorXd& known, double ridge_px2) const;
  static double squared_residual(const Sums& sums, const Eigen::VectorXd& solution);
  double ridge() const;
  Sums all() const { return sets_[0].sums + sets_[1].sums; }
  double num_pixels() const { return sets_[0].num_pixels + sets_[1].num_pixels; }

  LocalRegistrationOptions options_;
  geometry::ViewWarp frame_;  // in pixels of the stage
  std::array<Set, 2> sets_;
};

/// Returns the motion of each view if motion beyond an affine one makes the errors of the views
/// smaller by more than three standard errors, else nothing.
std::vector<geometry::ViewWarp> motion_that_pays(std::span<const LocalRegistration> views);

}  // namespace tomofield::alignment
