#pragma once

#include <cmath>
#include <cstdint>
#include <vector>

#include "align/gauge.h"
#include "align/joint_alignment.h"
#include "base/random.h"
#include "gaussian_scene.h"
#include "io/images/image_stack.h"
#include "measurement/prepare.h"
#include "scratch_directory.h"

namespace tomofield::testing {

/// Makes a series of Gaussians whose views are shifted at random.
class ShiftedSeries {
 public:
  using ViewCorrection = geometry::ViewCorrection;

  /// Makes views of `size` pixels across, a multiple of 48, with noise of deviation `noise`. The
  /// thickness is a third of the size.
  explicit ShiftedSeries(std::int64_t size = 48, double noise = 0.1)
      : size_(size), noise_(noise), scene_(scene_of(size)) {
    for (double tilt = -60; tilt <= 60; tilt += 6) tilt_deg_.push_back(tilt);
    base::Random random(4);
    for (std::size_t view = 0; view < tilt_deg_.size(); ++view) {
      right_.push_back({.shift_x_px = random.normal(), .shift_y_px = random.normal()});
      add_view(view, random);
    }
    specimen_.thickness = static_cast<double>(size / 3);
  }

  /// Calls use(problem) with the problem of aligning the series.
  template <typename Use>
  auto with_problem(const Use& use) const {
    tilt_series::TiltSeriesOptions options;
    options.images = io::image_stack_in_memory(pixels_, size_, size_, tilt_deg_, 10.0);
    options.contrast = Contrast::kBright;
    options.bead_diameter_nm = 0;
    options.resample = false;
    const tilt_series::TiltSeries series(options);
    const auto& processes = distributed::Communicator::alone();
    const alignment::JointProblem problem{
        .recorded = series,
        .plan = measurement::plan_realigned(series, specimen_, processes),
        .field = {},
        .scratch_dir = scratch_.path(),
        .progress = {},
        .stop_requested = {}};
    return use(problem);
  }

  /// Returns the root mean square of the errors of the shifts, without what views cannot tell.
  double error_px(std::vector<ViewCorrection> found) const {
    for (std::size_t view = 0; view < found.size(); ++view) {
      found[view].shift_x_px -= right_[view].shift_x_px;
      found[view].shift_y_px -= right_[view].shift_y_px;
    }
    alignment::remove_gauge(
        geometry::centred_geometry(size_, size_, specimen_.thickness, tilt_deg_), found);
    double squares = 0.0;
    for (const ViewCorrection& c : found)
      squares += c.shift_x_px * c.shift_x_px + c.shift_y_px * c.shift_y_px;
    return std::sqrt(squares / 2 / static_cast<double>(found.size()));
  }
  const std::vector<ViewCorrection>& right() const { return right_; }  ///< makes the views agree
  std::vector<ViewCorrection> none() const { return std::vector<ViewCorrection>(right_.size()); }

 private:
  // Returns Gaussians beyond the borders as well.
  static GaussianScene scene_of(std::int64_t size) {
    const double scale = static_cast<double>(size) / 48;
    return {static_cast<int>(150 * scale), {40 * scale, 26 * scale, 6 * scale}};
  }
  void add_view(std::size_t view, base::Random& random) {
    const double half = static_cast<double>(size_) / 2;
    for (std::int64_t i = 0; i < size_ * size_; ++i) {
      const double x = static_cast<double>(i % size_) + 0.5 - half - right_[view].shift_x_px;
      const double y = static_cast<double>(i / size_) + 0.5 - half - right_[view].shift_y_px;
      pixels_.push_back(
          static_cast<float>(scene_.projection(x, y, tilt_deg_[view]) + noise_ * random.normal()));
    }
  }

  ScratchDirectory scratch_;
  std::int64_t size_;
  double noise_;
  GaussianScene scene_;
  SpecimenOptions specimen_;
  std::vector<double> tilt_deg_;
  std::vector<ViewCorrection> right_;
  std::vector<float> pixels_;
};

}  // namespace tomofield::testing
