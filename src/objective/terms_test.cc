#include "objective/terms.h"

#include <gtest/gtest.h>

#include <cmath>
#include <vector>

namespace tomofield::objective {
namespace {

TEST(NoiseScale, TypicalNoiseIsThatOfTheMeanPrecision) {
  EXPECT_DOUBLE_EQ(typical_noise(std::vector<double>{2, 2, 2}), 2);
  EXPECT_DOUBLE_EQ(typical_noise(std::vector<double>{1, 0.5}), std::sqrt(2.0 / (1 + 4)));
}

TEST(NoiseScale, ConcavityFollowsTheNoiseDownToItsLeast) {
  EXPECT_NEAR(concavity(0.4, std::vector<double>(100, 3)), 0.4 * 3 / 10, 1e-9);
  EXPECT_EQ(concavity(0.4, std::vector<double>(100, 0.1)),
            concavity(0.4, std::vector<double>(100, 0.01)));
}

TEST(NoiseScale, LittleNoiseIsWeighedByTheContrast) {
  const double contrast = 6;
  EXPECT_EQ(gain_of_little_noise(3, contrast), 1);
  EXPECT_EQ(gain_of_little_noise(300, contrast), 1);
  // gain / noise is the weight beside ½ Σ (residual / noise)²: that times noise² does not change.
  const auto weight = [&](double noise) { return noise * gain_of_little_noise(noise, contrast); };
  EXPECT_DOUBLE_EQ(weight(0.1), weight(0.01));
  EXPECT_LT(weight(0.1), weight(3));
}

}  // namespace
}  // namespace tomofield::objective
