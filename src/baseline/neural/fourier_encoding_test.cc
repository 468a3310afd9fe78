#include "baseline/neural/fourier_encoding.h"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>
#include <vector>

namespace tomofield::baseline {
namespace {

constexpr int kNumFeatures = 300;
constexpr double kShortest = 8;

std::vector<float> encoded(const FourierEncoding& encoding, const Point& point) {
  std::vector<float> features(static_cast<std::size_t>(encoding.num_features()));
  encoding.encode(std::span(&point, 1), {}, features.data());
  return features;
}

TEST(FourierEncoding, IsOfPlaneWavesUpToAFrequencyInAllDirections) {
  const FourierEncoding encoding(kNumFeatures, kShortest, 3);
  // A plane wave w has w(p + d) + w(p − d) = 2 cos(2π b · d) w(p), so short steps d give |b|.
  const Point at = {61.3f, 40.7f, 22.9f};
  const std::vector<float> middle = encoded(encoding, at);
  std::vector<double> squared_frequency(middle.size());
  double of_axis[3] = {};
  for (std::size_t axis = 0; axis < 3; ++axis) {
    Point up = at, down = at;
    up[axis] += 1;
    down[axis] -= 1;
    const std::vector<float> above = encoded(encoding, up), below = encoded(encoding, down);
    for (std::size_t i = 0; i < middle.size(); ++i) {
      if (std::abs(middle[i]) < 0.2f) continue;
      const double cosine = static_cast<double>((above[i] + below[i]) / (2 * middle[i]));
      const double b = std::acos(std::min(cosine, 1.0)) / (2 * std::numbers::pi);
      squared_frequency[i] += b * b;
      of_axis[axis] += b * b;
    }
  }
  double highest = 0;
  for (const double square : squared_frequency) highest = std::max(highest, std::sqrt(square));
  EXPECT_GT(highest, 0.9 / kShortest);
  EXPECT_LT(highest, 1.01 / kShortest);
  for (const double sum : of_axis)
    EXPECT_NEAR(sum / (of_axis[0] + of_axis[1] + of_axis[2]), 1.0 / 3, 0.1);
}

TEST(FourierEncoding, FillsTheRangeOfASine) {
  const FourierEncoding encoding(kNumFeatures, kShortest, 4);
  double sum = 0, squares = 0, largest = 0;
  for (const float feature : encoded(encoding, {1000.5f, 2000.25f, 300})) {
    sum += static_cast<double>(feature);
    squares += static_cast<double>(feature) * static_cast<double>(feature);
    largest = std::max(largest, std::abs(static_cast<double>(feature)));
  }
  EXPECT_NEAR(sum / kNumFeatures, 0, 0.15);
  EXPECT_NEAR(squares / kNumFeatures, 0.5, 0.08);
  EXPECT_GT(largest, 0.999);
  EXPECT_LT(largest, 1 + 1e-5);
}

TEST(FourierEncoding, SeedsDiffer) {
  const Point at = {5, 6, 7};
  EXPECT_EQ(encoded({20, 8, 1}, at), encoded({20, 8, 1}, at));
  EXPECT_NE(encoded({20, 8, 1}, at), encoded({20, 8, 2}, at));
}

}  // namespace
}  // namespace tomofield::baseline
