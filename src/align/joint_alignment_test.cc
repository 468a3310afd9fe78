#include "align/joint_alignment.h"

#include <gtest/gtest.h>

#include <cmath>
#include <utility>
#include <vector>

#include "align/gauge.h"
#include "base/parallel.h"
#include "base/random.h"
#include "gaussian_scene.h"
#include "io/image_stack.h"
#include "measurement/prepare.h"
#include "scratch_directory.h"

namespace tomofield::align {
namespace {

using geometry::ViewCorrection;

constexpr std::int64_t kSize = 48;

// Makes a series of Gaussians whose views are shifted at random.
class ShiftedSeries {
 public:
  ShiftedSeries() {
    for (double tilt = -60; tilt <= 60; tilt += 6) tilt_deg_.push_back(tilt);
    base::Random random(4);
    for (std::size_t view = 0; view < tilt_deg_.size(); ++view) {
      right_.push_back({.shift_x_px = random.normal(), .shift_y_px = random.normal()});
      add_view(view, random);
    }
    specimen_.thickness = 16;
  }

  JointAlignment aligned(std::vector<ViewCorrection> start) const {
    tilt_series::TiltSeriesOptions options;
    options.images = io::image_stack_in_memory(pixels_, kSize, kSize, tilt_deg_, 10.0);
    options.contrast = Contrast::kBright;
    options.bead_diameter_nm = 0;
    options.resample = false;
    const tilt_series::TiltSeries series(options);
    const auto& processes = distributed::Communicator::alone();
    return align_jointly({.recorded = series,
                          .plan = measurement::plan_realigned(series, specimen_, processes),
                          .field = {},
                          .scratch_dir = scratch_.path(),
                          .progress = {},
                          .stop_requested = {}},
                         std::move(start), processes);
  }

  // Returns the root mean square of the errors of the shifts, without what views cannot tell.
  double error_px(std::vector<ViewCorrection> found) const {
    for (std::size_t view = 0; view < found.size(); ++view) {
      found[view].shift_x_px -= right_[view].shift_x_px;
      found[view].shift_y_px -= right_[view].shift_y_px;
    }
    remove_gauge(geometry::centred_geometry(kSize, kSize, specimen_.thickness, tilt_deg_), found);
    double squares = 0.0;
    for (const ViewCorrection& c : found)
      squares += c.shift_x_px * c.shift_x_px + c.shift_y_px * c.shift_y_px;
    return std::sqrt(squares / 2 / static_cast<double>(found.size()));
  }
  std::vector<ViewCorrection> none() const { return std::vector<ViewCorrection>(right_.size()); }

 private:
  void add_view(std::size_t view, base::Random& random) {
    for (std::int64_t i = 0; i < kSize * kSize; ++i) {
      const double x = static_cast<double>(i % kSize) + 0.5 - kSize / 2.0 - right_[view].shift_x_px;
      const double y = static_cast<double>(i / kSize) + 0.5 - kSize / 2.0 - right_[view].shift_y_px;
      pixels_.push_back(
          static_cast<float>(scene_.projection(x, y, tilt_deg_[view]) + 0.1 * random.normal()));
    }
  }

  testing::ScratchDirectory scratch_;
  testing::GaussianScene scene_{150, {40, 26, 6}};  // beyond the borders as well
  measurement::SpecimenOptions specimen_;
  std::vector<double> tilt_deg_;
  std::vector<ViewCorrection> right_;  // makes the views agree
  std::vector<float> pixels_;
};

TEST(JointAlignment, FindsRandomShifts) {
  const ShiftedSeries series;
  EXPECT_GT(series.error_px(series.none()), 0.7);
  const JointAlignment found = series.aligned(series.none());
  EXPECT_LT(series.error_px(found.corrections), 0.15);
  for (const ViewAgreement& view : found.agreement) {
    EXPECT_GT(view.correlation, 0.9);
    EXPECT_LT(view.error_px[0], 0.3);
    EXPECT_LT(view.error_px[1], 0.3);
  }
}

TEST(JointAlignment, SameBitsForAnyNumberOfThreads) {
  const ShiftedSeries series;
  const auto run = [&](int threads) {
    base::set_thread_count(threads);
    const JointAlignment found = series.aligned(series.none());
    base::set_thread_count(0);
    return found;
  };
  const JointAlignment one = run(1), two = run(2);
  EXPECT_EQ(one.corrections, two.corrections);
  EXPECT_EQ(one.steps_px, two.steps_px);
}

}  // namespace
}  // namespace tomofield::align
