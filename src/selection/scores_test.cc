#include "selection/scores.h"

#include <gtest/gtest.h>

#include <cmath>
#include <utility>
#include <vector>

namespace tomofield::selection {
namespace {

HeldOutScore with_errors(std::vector<double> view_error) { return {0, std::move(view_error)}; }

TEST(MostViewsPrefer, CountsViewsWhateverTheirErrors) {
  const HeldOutScore often = with_errors({1.0, 5.0, 2.0, 9.0}),
                     rarely = with_errors({1.1, 5.1, 2.1, 3.0});
  EXPECT_TRUE(most_views_prefer(often, rarely));
  EXPECT_FALSE(most_views_prefer(rarely, often));
  const HeldOutScore half = with_errors({1.1, 5.1, 1.9, 3.0});
  EXPECT_FALSE(most_views_prefer(half, with_errors({1.0, 5.0, 2.0, 9.0})));
}

TEST(StandardErrorOfDifference, IgnoresWhatTrialsShare) {
  const HeldOutScore a = with_errors({1.0, 5.0, 2.0}), b = with_errors({1.1, 5.1, 2.1}),
                     c = with_errors({2.0, 5.0, 2.0});
  EXPECT_NEAR(standard_error_of_difference(a, b), 0.0, 1e-7);
  EXPECT_NEAR(standard_error_of_difference(a, c), 1.0 / 3, 1e-12);  // s = 1/√3, over √3
}

// Returns an error that grows with the distance from the best weight, the same for all views.
HeldOutScore parabola(double weight, double best) {
  const double distance = std::log2(weight / best);
  const double error = 1 + 0.01 * distance * distance;
  return {error, {error, error, error}};
}

TEST(SearchWeight, EndsWithinAStepOfTheBestFromAnywhereWithinItsReach) {
  for (const double first : {0.05, 1.0, 7.0, 800.0}) {
    const double found = search_weight(first, [](double weight) { return parabola(weight, 6); });
    EXPECT_LT(std::abs(std::log2(found / 6)), 0.5 + 1e-9) << first;
  }
}

TEST(SearchWeight, StopsAtAFactorOf256) {
  const double found = search_weight(1.0, [](double weight) { return parabola(weight, 1e9); });
  EXPECT_GE(found, 256);
  EXPECT_LE(found, 256 * 2 * std::sqrt(2.0) + 1e-9);
}

TEST(SearchWeight, TakesTheLargestOfThoseThatViewsCannotTellApart) {
  // Up to a weight of 15 views differ by more among each other than weights do.
  const auto score = [](double weight) -> HeldOutScore {
    const double error = weight > 15 ? 2 : 1 + 1e-3 * std::abs(std::log2(weight / 5));
    const double spread = weight > 15 ? 0 : 0.1 * std::sin(100 * weight);
    return {error, {error + spread, error - spread}};
  };
  const double found = search_weight(5.0, score);
  EXPECT_EQ(found, 10.0);
}

TEST(FirstAsGoodAsTheBest, CountsWhatViewsCannotTellApartAsEqual) {
  const HeldOutScore best{1.0, {0.5, 1.5}}, unsure{1.1, {1.0, 1.2}}, surely_worse{1.2, {0.7, 1.7}};
  EXPECT_EQ(first_as_good_as_the_best({surely_worse, unsure, best}), 1u);
  EXPECT_EQ(first_as_good_as_the_best({surely_worse, best}), 1u);
}

}  // namespace
}  // namespace tomofield::selection
