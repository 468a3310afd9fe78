#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include <Eigen/Core>

#include "align/freedoms.h"
#include "align/local/local_registration.h"
#include "geometry/view_correction.h"

namespace tomofield::alignment {

/// A view and its prediction, both [y, x] in pixels of a stage.
struct ImagePair {
  std::int64_t width = 0, height = 0;
  double pixel = 1.0;  ///< size of a pixel of the stage, in pixels of the view before binning
  double centre_x = 0.0, centre_y = 0.0;  ///< of the aligned view, in pixels of the stage
  std::span<const float> measured;        ///< NaN where there is no measurement
  std::span<const float> predicted;
  /// Derivative of the prediction by the tilt angle in degrees; empty if it is not known.
  std::span<const float> by_tilt = {};
};

/// The blur of both images in a registration, and the sizes of the changes that it expects.
struct RegistrationOptions {
  double blur_px = 1.0;  ///< of both images, in pixels of the stage
  // Standard deviations of the changes that are expected. They keep small what the pixels say
  // little about.
  double rotation_prior_deg = 0.5;
  double magnification_prior = 0.002;
  double tilt_prior_deg = 0.2;
};

/// Returns how many pixels a Gaussian blur makes one independent sample of.
double pixels_per_sample(double blur_px);

/// Describes the difference between a view and its prediction to first order, as least squares
///
///   b ≈ a p + a (εx ∂p/∂x + εy ∂p/∂y) + a δθ ∂p/∂θ + a quadratic trend,
///   εx = tx − φ y + m x,   εy = ty + φ x + m y
///
/// over the pixels that are measured, with Huber's weights. Positions are relative to the centre of
/// the view. The gradients are those of the prediction, since those of noisy data would make the
/// estimates too small. The scale a and the trend are free: they belong to the exposure.
///
/// The pixels are divided like a chessboard into two sets of blocks. Each set tells how well a
/// solution of the other one predicts it.
class Registration {
 public:
  /// Adds the pixels to `local` as well, unless that is null.
  Registration(const ImagePair& images, const RegistrationOptions& options,
               LocalRegistration* local = nullptr);

  /// Returns the correction of the view that makes it agree with the prediction: none if there are
  /// fewer independent samples than unknowns.
  geometry::ViewCorrection solve(const Freedoms& freedoms) const;
  /// Returns the standard error of the shift in x and in y, in pixels of the view before binning.
  std::array<double, 2> shift_error(const Freedoms& freedoms) const;
  /// Returns the mean squared residual of each set, as the solution of the other set leaves it,
  /// averaged over both sets, in the square of the images' unit.
  double predicted_error(const Freedoms& freedoms) const;
  /// Returns the variance of the measured pixels without trends.
  double measured_variance() const;
  /// Returns the correlation of the view with its prediction where they are, without trends.
  double correlation() const;
  /// Returns the number of pixels that count.
  std::int64_t num_pixels() const;

 private:
  // Columns of the least-squares problem; the last one is the measured view.
  enum Column { kX, kY, kRotation, kMagnification, kTilt, kScale, kTrend, kMeasured = kTrend + 6 };
  static constexpr int kColumns = kMeasured + 1;
  using Sums = Eigen::Matrix<double, kColumns, kColumns>;
  using Row = Eigen::Matrix<double, kColumns, 1>;

  struct Solution {
    std::vector<int> columns;  // those that are free
    Eigen::VectorXd values;
    Eigen::MatrixXd covariance;  // without the noise's variance
  };
  struct Prepared;  // the blurred images
  class RowBatch;
  Row row_of(const Prepared& images, std::int64_t x, std::int64_t y) const;
  void add_up(const Prepared& images, const Solution* last, LocalRegistration* local);
  double ridge(int column) const;
  Solution solve_on(const Sums& sums, const Freedoms& freedoms) const;
  static double scale_of(const Solution& solution);
  double squared_residual(const Sums& sums, const Solution& solution) const;
  double without_trends(int a, int b) const;
  double residual_variance(const Freedoms& freedoms) const;
  Sums all() const { return sums_[0] + sums_[1]; }

  RegistrationOptions options_;
  double pixel_ = 1.0;
  double half_size_ = 1.0;  // positions are divided by it, in pixels of the stage
  bool knows_tilt_ = false;
  double pixels_per_sample_ = 1.0;  // pixels that the blur makes one independent sample of
  double noise_variance_ = 0.0, scale_ = 0.0;  // of the solution for the shift alone
  std::array<Sums, 2> sums_;
  std::array<std::int64_t, 2> num_pixels_{};
};

}  // namespace tomofield::alignment
