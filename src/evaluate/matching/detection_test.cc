#include "evaluate/matching/detection.h"

#include <gtest/gtest.h>

namespace tomofield::evaluate {
namespace {

TEST(ScoreDetections, IsOneForAPerfectOrder) {
  const auto score =
      score_detections({{0.1f, false}, {0.9f, true}, {0.2f, false}, {0.8f, true}}, 2);
  EXPECT_DOUBLE_EQ(score.average_precision, 1.0);
  EXPECT_DOUBLE_EQ(score.best_dice, 1.0);
  EXPECT_FLOAT_EQ(static_cast<float>(score.best_threshold), 0.8f);
}

TEST(ScoreDetections, CountsFalseOnesAboveTrueOnes) {
  // Precisions at the true ones are 1/1, 2/3 and 3/5.
  const auto score = score_detections({{5, true}, {4, false}, {3, true}, {2, false}, {1, true}}, 3);
  EXPECT_NEAR(score.average_precision, (1.0 + 2.0 / 3.0 + 3.0 / 5.0) / 3.0, 1e-12);
  EXPECT_NEAR(score.best_dice, 2.0 * 3.0 / (5.0 + 3.0), 1e-12);
}

TEST(ScoreDetections, CountsTrueThingsThatWereNotFound) {
  const auto score = score_detections({{1, true}}, 4);
  EXPECT_DOUBLE_EQ(score.average_precision, 0.25);
  EXPECT_DOUBLE_EQ(score.best_dice, 2.0 / 5.0);
}

TEST(ScoreDetections, TakesEqualScoresTogetherWhateverTheirOrder) {
  const auto first = score_detections({{1, true}, {1, false}}, 1);
  const auto second = score_detections({{1, false}, {1, true}}, 1);
  EXPECT_DOUBLE_EQ(first.average_precision, 0.5);
  EXPECT_DOUBLE_EQ(second.average_precision, 0.5);
}

TEST(ScoreDetections, IsZeroWithoutTrueThings) {
  EXPECT_EQ(score_detections({{1, false}}, 0).average_precision, 0.0);
  EXPECT_EQ(score_detections({}, 3).best_dice, 0.0);
}

}  // namespace
}  // namespace tomofield::evaluate
