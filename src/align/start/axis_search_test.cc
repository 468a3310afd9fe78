#include "align/start/axis_search.h"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>
#include <string>
#include <vector>

#include "base/progress.h"
#include "shifted_series.h"

namespace tomofield::alignment {
namespace {

using geometry::ViewCorrection;
using testing::ShiftedSeries;

constexpr double kDegree = std::numbers::pi / 180;

std::vector<ViewCorrection> turned(std::vector<ViewCorrection> corrections, double axis_deg) {
  for (ViewCorrection& correction : corrections)
    correction = correction.then({.rotation_rad = axis_deg * kDegree});
  return corrections;
}

double mean_rotation_deg(const std::vector<ViewCorrection>& corrections) {
  double sum = 0.0;
  for (const ViewCorrection& correction : corrections) sum += correction.rotation_rad / kDegree;
  return sum / static_cast<double>(corrections.size());
}

std::vector<ViewCorrection> refined(const ShiftedSeries& series,
                                    const std::vector<ViewCorrection>& start) {
  return series.with_problem([&](const JointProblem& problem) {
    return with_refined_axis(problem, start, distributed::Communicator::alone());
  });
}

const ShiftedSeries& large_series() {
  static const ShiftedSeries series(192);
  return series;
}

TEST(RefinedAxis, IsFoundFromBothSides) {
  const ShiftedSeries& series = large_series();
  const double left_deg = mean_rotation_deg(refined(series, turned(series.right(), -1.4)));
  const double right_deg = mean_rotation_deg(refined(series, turned(series.right(), 0.3)));
  EXPECT_NEAR(left_deg, right_deg, 0.01);
  EXPECT_NEAR(right_deg, 0.0, 0.1);
}

TEST(RefinedAxis, SmallViewsKeepTheirAxis) {
  const ShiftedSeries series;
  const std::vector<ViewCorrection> start = turned(series.right(), 1.0);
  EXPECT_EQ(refined(series, start), start);
}

TEST(RefinedAxis, TellsItsProgressAndStops) {
  const ShiftedSeries& series = large_series();
  series.with_problem([&](const JointProblem& given) {
    std::vector<std::string> details;
    const JointProblem problem{
        .recorded = given.recorded,
        .plan = given.plan,
        .field = given.field,
        .scratch_dir = given.scratch_dir,
        .progress = [&](const base::ProgressReport& report) { details.push_back(report.detail); },
        .stop_requested = [&] { return !details.empty(); }};
    EXPECT_THROW(with_refined_axis(problem, series.none(), distributed::Communicator::alone()),
                 base::StopRequested);
    EXPECT_EQ(details, std::vector<std::string>{"tilt axis, fit 1"});
  });
}

}  // namespace
}  // namespace tomofield::alignment
