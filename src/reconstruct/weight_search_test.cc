#include "reconstruct/weight_search.h"

#include <gtest/gtest.h>

#include <utility>

namespace tomofield::reconstruct {
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

TEST(FirstAsGoodAsTheBest, CountsWhatViewsCannotTellApartAsEqual) {
  const HeldOutScore best{1.0, {0.5, 1.5}}, unsure{1.1, {1.0, 1.2}}, surely_worse{1.2, {0.7, 1.7}};
  EXPECT_EQ(first_as_good_as_the_best({surely_worse, unsure, best}), 1u);
  EXPECT_EQ(first_as_good_as_the_best({surely_worse, best}), 1u);
}

}  // namespace
}  // namespace tomofield::reconstruct
