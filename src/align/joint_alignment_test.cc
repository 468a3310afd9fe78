#include "align/joint_alignment.h"

#include <gtest/gtest.h>

#include "base/threads/parallel.h"
#include "shifted_series.h"

namespace tomofield::alignment {
namespace {

using testing::ShiftedSeries;

JointAlignment aligned(const ShiftedSeries& series) {
  return series.with_problem([&](const JointProblem& problem) {
    return align_jointly(problem, series.none(), distributed::Communicator::alone());
  });
}

TEST(JointAlignment, FindsRandomShifts) {
  const ShiftedSeries series;
  EXPECT_GT(series.error_px(series.none()), 0.7);
  const JointAlignment found = aligned(series);
  EXPECT_LT(series.error_px(found.corrections), 0.15);
  for (const ViewAgreement& view : found.agreement) {
    EXPECT_GT(view.correlation, 0.9);
    EXPECT_LT(view.error_px[0], 0.3);
    EXPECT_LT(view.error_px[1], 0.3);
  }
}

TEST(JointAlignment, StepsOfNoisyViewsDieAway) {
  const ShiftedSeries series(96, 4.0);
  const JointAlignment found = aligned(series);
  EXPECT_LT(found.agreement[10].correlation, 0.5) << "the views are not noisy";
  EXPECT_LT(found.steps_px.back(), 0.25) << "steps go back and forth";
  EXPECT_LT(series.error_px(found.corrections), 0.7);
}

TEST(JointAlignment, SameBitsForAnyNumberOfThreads) {
  const ShiftedSeries series;
  const auto run = [&](int threads) {
    base::set_thread_count(threads);
    const JointAlignment found = aligned(series);
    base::set_thread_count(0);
    return found;
  };
  const JointAlignment one = run(1), two = run(2);
  EXPECT_EQ(one.corrections, two.corrections);
  EXPECT_EQ(one.steps_px, two.steps_px);
}

}  // namespace
}  // namespace tomofield::alignment
