#include "baseline/neural/lazy_adam.h"

#include <gtest/gtest.h>

#include <cmath>
#include <vector>

namespace tomofield::baseline {
namespace {

TEST(LazyAdam, FirstStepHasTheLengthOfTheRate) {
  LazyAdam adam(3);
  std::vector<float> parameters = {1, 1, 1};
  adam.gradient()[0] = 100;
  adam.gradient()[2] = -0.001f;
  adam.step(0.25, parameters);
  EXPECT_NEAR(parameters[0], 0.75, 1e-5);
  EXPECT_EQ(parameters[1], 1);
  EXPECT_NEAR(parameters[2], 1.25, 1e-5);
  for (const float g : adam.gradient()) EXPECT_EQ(g, 0);
}

TEST(LazyAdam, LeavesWhatHasNoGradientAloneWithItsMoments) {
  constexpr std::size_t kCount = 1000, kFar = 700;
  LazyAdam adam(kCount), other(kCount);
  std::vector<float> parameters(kCount), expected(kCount);
  const auto step = [&](LazyAdam& of, std::vector<float>& moved, std::size_t at) {
    of.gradient()[at] = 1.5f - moved[at];
    of.step(0.1, moved);
  };
  for (int i = 0; i < 5; ++i) {
    step(adam, parameters, 0);
    step(adam, parameters, kFar);  // must not change the parameters at 0
    step(other, expected, 0);
  }
  EXPECT_EQ(parameters[0], expected[0]);
  EXPECT_EQ(parameters[kFar], expected[0]);
  EXPECT_EQ(parameters[kFar - 100], 0);
}

}  // namespace
}  // namespace tomofield::baseline
