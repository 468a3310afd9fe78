#include "tune/scores.h"

#include <gtest/gtest.h>

#include <cmath>
#include <utility>
#include <vector>

namespace tomofield::tune {
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

TEST(Difference, IgnoresWhatTrialsShare) {
  const HeldOutScore a = with_errors({1.0, 5.0, 2.0}), worse = with_errors({1.1, 5.5, 2.2});
  EXPECT_NEAR(difference(worse, a).log_ratio, std::log(1.1), 1e-12);
  EXPECT_NEAR(difference(worse, a).standard_error, 0.0, 1e-12);
  EXPECT_TRUE(difference(worse, a).is_beyond(2));
  EXPECT_FALSE(difference(a, worse).is_beyond(2));
}

TEST(Difference, GrowsUnsureWithTheScatterOfTheViews) {
  const HeldOutScore a = with_errors({1, 1, 1, 1, 1}),
                     b = with_errors({std::exp(-2), std::exp(-1), 1, std::exp(1), std::exp(2)});
  EXPECT_NEAR(difference(b, a).log_ratio, 0.0, 1e-12);
  EXPECT_NEAR(difference(b, a).standard_error, 1.4826 / std::sqrt(5), 1e-4);
}

// In yardstick B a view at 60° is worse by 5 % with a penalty that predicts all others better.
TEST(Difference, OneViewAtTheEndOfTheTiltsDoesNotDecide) {
  const HeldOutScore smooth = with_errors({1.283, 1.031, 0.961, 0.926, 0.949, 0.967, 1.018}),
                     concave = with_errors({1.450, 0.965, 0.927, 0.899, 0.916, 0.929, 1.013});
  EXPECT_TRUE(difference(smooth, concave).is_beyond(2));
}

TEST(Difference, ComparesTheTotalsOfTrialsWithoutViews) {
  EXPECT_NEAR(difference({2.0, {}}, {1.0, {}}).log_ratio, std::log(2.0), 1e-12);
}

// Returns an error that grows with the distance from the best weight, the same for all views.
HeldOutScore parabola(double weight, double best) {
  const double distance = std::log2(weight / best);
  const double error = 1 + 0.01 * distance * distance;
  return {error, {error, error, error}};
}

TEST(DifferenceOfMeans, FollowsTheFewPatchesWithStructure) {
  const HeldOutScore flat{.patch_error = {1, 1, 1, 1, 1, 1, 2, 2}};
  const HeldOutScore detailed{.patch_error = {1.01, 1.01, 1.01, 1.01, 1.01, 1.01, 1.5, 1.5}};
  EXPECT_GT(difference(detailed, flat).log_ratio, 0);
  EXPECT_NEAR(difference_of_means(detailed, flat).log_ratio, std::log(9.06 / 10), 1e-12);
}

TEST(DifferenceOfMeans, HasTheScatterOfTheRatioOfTwoMeans) {
  const HeldOutScore a{.patch_error = {1, 3}}, b{.patch_error = {2, 2}};
  const Difference d = difference_of_means(a, b);
  EXPECT_NEAR(d.log_ratio, 0, 1e-12);
  EXPECT_NEAR(d.standard_error, std::sqrt(2.0) / 4, 1e-12);
  EXPECT_EQ(difference_of_means(a, a).standard_error, 0);
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
    return {error, {error + spread, error, error - spread}};
  };
  const double found = search_weight(5.0, score);
  EXPECT_EQ(found, 10.0);
}

TEST(Difference, IsThatOfPatchesWhereBothHaveThem) {
  HeldOutScore a = with_errors({2.0, 2.0, 2.0}), b = with_errors({1.0, 1.0, 1.0});
  a.patch_error = b.patch_error = {1.0, 3.0};
  EXPECT_EQ(difference(a, b).log_ratio, 0.0);
  b.patch_error.clear();
  EXPECT_NEAR(difference(a, b).log_ratio, std::log(2.0), 1e-12);
}

TEST(AsGoodAsTheBest, CountsWhatViewsCannotTellApartAsEqual) {
  const HeldOutScore best{1.0, {0.5, 1.5, 1.0}}, unsure{1.1, {0.6, 1.4, 1.05}},
      surely_worse{1.2, {0.6, 1.8, 1.2}};
  using Indices = std::vector<std::size_t>;
  EXPECT_EQ(as_good_as_the_best({surely_worse, unsure, best}, 2), (Indices{1, 2}));
  EXPECT_EQ(as_good_as_the_best({surely_worse, best}), Indices{1});
}

}  // namespace
}  // namespace tomofield::tune
