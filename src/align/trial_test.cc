#include "align/trial.h"

#include <gtest/gtest.h>

#include <cmath>
#include <vector>

#include "base/progress.h"
#include "shifted_series.h"

namespace tomofield::alignment {
namespace {

using geometry::ViewCorrection;
using testing::ShiftedSeries;

// Holds the trials of two alignments of a series after they were compared.
class ComparedTrials {
 public:
  ComparedTrials(const JointProblem& problem, const std::vector<ViewCorrection>& one,
                 const std::vector<ViewCorrection>& other)
      : before(problem, one, distributed::Communicator::alone()),
        after(problem, other, distributed::Communicator::alone()),
        comparison(compare(before, after)) {}
  AlignmentTrial before, after;
  Comparison comparison;
};

TEST(AlignmentTrial, WidePixelsTellAWrongAlignment) {
  const ShiftedSeries series;
  series.with_problem([&](const JointProblem& problem) {
    ComparedTrials trials(problem, series.none(), series.right());
    EXPECT_TRUE(trials.comparison.gain.exceeds(3.0));
    EXPECT_LT(trials.comparison.after, 0.5 * trials.comparison.before);
    EXPECT_EQ(trials.after.coarse_errors().size(), 2u);  // of 21 views
    // The rest of the fits tells the same.
    EXPECT_LT(trials.after.fine_errors()[1], trials.before.fine_errors()[1]);
  });
}

TEST(AlignmentTrial, FinePixelsDecideBetweenEqualAlignments) {
  const ShiftedSeries series;
  series.with_problem([&](const JointProblem& problem) {
    ComparedTrials trials(problem, series.right(), series.right());
    EXPECT_EQ(trials.comparison.gain.mean, 0.0);
    EXPECT_FALSE(trials.comparison.gain.exceeds(1.0));
    EXPECT_EQ(trials.before.fine_errors(), trials.after.fine_errors());
    EXPECT_NE(trials.before.fine_errors(), trials.before.coarse_errors());
  });
}

TEST(AlignmentTrial, LeavesOutAViewWithoutPixels) {
  const ShiftedSeries series;
  series.with_problem([&](const JointProblem& problem) {
    std::vector<ViewCorrection> away = series.right();
    away[4].shift_x_px += 1000.0;  // the first view that is held out
    ComparedTrials trials(problem, series.right(), away);
    EXPECT_TRUE(std::isnan(trials.after.coarse_errors()[0]));
    EXPECT_TRUE(std::isfinite(trials.comparison.before));
    EXPECT_EQ(trials.comparison.after, trials.comparison.before) << "the other view is the same";
  });
}

TEST(AlignmentTrial, StopsInEitherPartIfAsked) {
  const ShiftedSeries series;
  series.with_problem([&](const JointProblem& problem) {
    bool is_asked = true;
    JointProblem stopping = problem;
    stopping.stop_requested = [&] { return is_asked; };
    AlignmentTrial trial(stopping, series.right(), distributed::Communicator::alone());
    EXPECT_THROW(trial.coarse_errors(), base::StopRequested);
    AlignmentTrial later(stopping, series.right(), distributed::Communicator::alone());
    is_asked = false;
    EXPECT_EQ(later.coarse_errors().size(), 2u);
    is_asked = true;
    EXPECT_THROW(later.fine_errors(), base::StopRequested);
  });
}

}  // namespace
}  // namespace tomofield::alignment
