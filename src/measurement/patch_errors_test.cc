#include "measurement/patch_errors.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>

namespace tomofield::measurement {
namespace {

// Returns a view of two rows that is predicted as 0 and measured as `value`.
PredictedView uniform_view(std::int64_t width, float value) {
  const auto size = static_cast<std::size_t>(2 * width);
  return {width, 2, std::vector<float>(size, value), std::vector<float>(size)};
}

TEST(PatchErrors, AreMeanSquaresOverTheNoiseOfTheirView) {
  const std::vector<PredictedView> views = {uniform_view(kPatchColumns + 3, 2.0f),
                                            uniform_view(kPatchColumns, 3.0f)};
  const std::vector<double> weights = {0.5, 2.0};
  EXPECT_EQ(patch_errors(views, weights), (std::vector<double>{2.0, 2.0, 18.0}));
}

TEST(PatchErrors, PixelsThatAreNotMeasuredDoNotCount) {
  std::vector<PredictedView> views = {uniform_view(2 * kPatchColumns, 1.0f)};
  const auto spoil = [&](std::int64_t x, std::int64_t y) {
    const auto at = static_cast<std::size_t>(y * views[0].width + x);
    views[0].measured[at] = std::numeric_limits<float>::quiet_NaN();
    views[0].predicted[at] = 100.0f;
  };
  for (std::int64_t x = 0; x < kPatchColumns; ++x) spoil(x, 0);
  EXPECT_EQ(patch_errors(views, std::vector<double>{1.0}), (std::vector<double>{1.0, 1.0}));
  spoil(0, 1);  // more than half of the first patch
  EXPECT_EQ(patch_errors(views, std::vector<double>{1.0}), (std::vector<double>{1.0}));
}

}  // namespace
}  // namespace tomofield::measurement
