#include "tune/trials.h"

#include <gtest/gtest.h>

#include <cmath>
#include <cstddef>
#include <vector>

namespace tomofield::tune {
namespace {

using Numbers = std::vector<double>;

// Makes trials whose error is least at some number, and remembers which were made together.
class Together : public ::testing::Test {
 protected:
  Trials<double> trials_{Trials<double>::RunTrials([this](const Numbers& numbers) {
                           batches_.push_back(numbers);
                           std::vector<Trial<double>> made;
                           for (const double x : numbers) {
                             const double error = 1 + std::abs(std::log(x / best_));
                             made.push_back({x, {error, {error, error}}});
                           }
                           return made;
                         }),
                         [](double a, double b) { return std::abs(a / b - 1) < 1e-9; }};
  double best_ = 9;
  std::vector<Numbers> batches_;
};

TEST_F(Together, MakesWhatIsMissingOnce) {
  trials_.make({1, 2, 1 + 1e-12});
  trials_.make({2, 3});
  trials_.make({3, 1});
  EXPECT_EQ(batches_, (std::vector<Numbers>{{1, 2}, {3}}));
  EXPECT_EQ(trials_.trial(3).settings, 3);
  ASSERT_EQ(trials_.made().size(), 3u);
  EXPECT_EQ(trials_.made()[1].settings, 2);
}

TEST_F(Together, CandidatesAreMadeAtTheSameTime) {
  EXPECT_EQ(trials_.preferred_by_most_views(5, 8), 8);
  EXPECT_EQ(trials_.first_as_good({4, 8, 9, 10}), 9);
  EXPECT_EQ(batches_, (std::vector<Numbers>{{5, 8}, {4, 9, 10}}));
}

TEST_F(Together, WeightsOnBothSidesAreMadeAtTheSameTime) {
  const double found =
      trials_.with_best_weight(0, 9, [](double& settings, double weight) { settings = weight; });
  EXPECT_NEAR(found, 9, 1e-9);
  const double root = std::sqrt(2.0);
  const std::vector<Numbers> expected = {{36, 9}, {9 * 0.25}, {4.5, 18}, {9 / root, 9 * root}};
  ASSERT_EQ(batches_.size(), expected.size());
  for (std::size_t i = 0; i < expected.size(); ++i) {
    ASSERT_EQ(batches_[i].size(), expected[i].size());
    for (std::size_t k = 0; k < expected[i].size(); ++k)
      EXPECT_DOUBLE_EQ(batches_[i][k], expected[i][k]);
  }
}

}  // namespace
}  // namespace tomofield::tune
