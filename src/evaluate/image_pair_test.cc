#include "evaluate/image_pair.h"

#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <limits>

#include "base/random.h"

namespace tomofield::evaluate {
namespace {

constexpr float kNone = std::numeric_limits<float>::quiet_NaN();

// Returns round details of several sizes, moved by (dx, dy), on a ramp that stays where it is.
Image details(std::int64_t width, std::int64_t height, double dx, double dy) {
  Image image{width, height, {}};
  for (std::int64_t y = 0; y < height; ++y) {
    for (std::int64_t x = 0; x < width; ++x) {
      double value = 0.01 * static_cast<double>(x);
      for (int spot = 0; spot < 9; ++spot) {
        const double cx = static_cast<double>(width) * (0.3 + 0.05 * (spot * 7 % 10)) + dx;
        const double cy = static_cast<double>(height) * (0.3 + 0.05 * (spot * 3 % 10)) + dy;
        const double radius = 1.5 + 0.2 * spot;
        const double distance =
            std::hypot(static_cast<double>(x) - cx, static_cast<double>(y) - cy);
        value += std::exp(-distance * distance / (2 * radius * radius));
      }
      image.values.push_back(static_cast<float>(value));
    }
  }
  return image;
}

TEST(ImagePair, DisplacementIsThatOfTheContent) {
  const Image reference = details(60, 47, 0, 0);
  for (const auto& [dx, dy] : {std::array{0.0, 0.0}, std::array{3.0, -2.0}, std::array{-5.4, 0.3},
                               std::array{0.25, 6.5}}) {
    const auto found = displacement(reference, details(60, 47, dx, dy));
    EXPECT_NEAR(found[0], dx, 0.3);
    EXPECT_NEAR(found[1], dy, 0.3);
  }
}

TEST(ImagePair, DisplacementIgnoresWhatOneImageLacks) {
  const Image reference = details(64, 64, 0, 0);
  Image moved = details(64, 64, 2, 3);
  for (std::size_t i = 0; i < 64 * 12; ++i) moved.values[i] = i % 3 == 0 ? kNone : moved.values[i];
  for (float& value : moved.values) value = 5.0f - 2.0f * value;  // the scale has no say
  const auto opposite = displacement(moved, details(64, 64, 0, 0));
  EXPECT_GT(std::hypot(opposite[0] + 2, opposite[1] + 3), 1.0);  // but its sign has
  for (float& value : moved.values) value = -value;
  const auto found = displacement(reference, moved);
  EXPECT_NEAR(found[0], 2, 0.3);
  EXPECT_NEAR(found[1], 3, 0.3);
}

// The noise of each image is `blur` · its neighbour's along x + fresh noise.
TEST(ImagePair, NeighboursOfCorrelatedNoiseAreAlike) {
  for (const double blur : {0.0, 0.6}) {
    const Image told = details(90, 70, 0, 0);
    Image seen = told;
    base::Random random(3);
    for (std::int64_t y = 0; y < seen.height; ++y) {
      double noise = 0;
      for (std::int64_t x = 0; x < seen.width; ++x) {
        noise = blur * noise + random.normal();
        seen.values[static_cast<std::size_t>(y * seen.width + x)] += static_cast<float>(noise);
      }
    }
    for (std::size_t i = 0; i < 500; ++i) seen.values[7 * i] = kNone;
    for (const int distance : {1, 2}) {
      const auto [x, y] = difference_correlation(seen, told, distance);
      EXPECT_NEAR(x, std::pow(blur, distance), 0.05);
      EXPECT_NEAR(y, 0.0, 0.05);
    }
  }
  const Image row{3, 1, {1, 4, 2}};
  EXPECT_EQ(difference_correlation(row, row, 1), (std::array{0.0, 0.0}));
  EXPECT_EQ(difference_correlation(row, row, 5), (std::array{0.0, 0.0}));
}

TEST(ImagePair, ShiftedCorrelationFindsTheContentWithinReach) {
  const Image here = details(48, 40, 0, 0), there = details(48, 40, 3, -2);
  EXPECT_GT(shifted_correlation(here, there, 3), 0.98);
  EXPECT_NEAR(shifted_correlation(here, there, 3), shifted_correlation(there, here, 3), 1e-12);
  EXPECT_LT(shifted_correlation(here, there, 1), 0.95);
  EXPECT_EQ(shifted_correlation(here, there, 0), correlation(here, there));
}

TEST(ImagePair, ReducedImageHasTheMeansOfMeasuredPixels) {
  const Image image{3, 2, {1, 3, 5, kNone, 8, kNone}};
  const Image small = reduced(image, 2);
  EXPECT_EQ(small.width, 2);
  EXPECT_EQ(small.height, 1);
  EXPECT_FLOAT_EQ(small.values[0], 4);
  EXPECT_FLOAT_EQ(small.values[1], 5);
  EXPECT_TRUE(std::isnan(reduced({2, 2, {1, kNone, kNone, kNone}}, 2).values[0]));
}

TEST(ImagePair, ColumnMeansLeaveTheRest) {
  const Image image{2, 2, {1, kNone, 3, 7}};
  EXPECT_EQ(column_means(image), (std::vector<double>{2, 7}));
  const Image rest = without_column_means(image);
  EXPECT_EQ(rest.values[0], -1);
  EXPECT_TRUE(std::isnan(rest.values[1]));
  EXPECT_EQ(rest.values[3], 0);
}

TEST(ImagePair, CorrelationIsThatOfCommonPixels) {
  const Image one{4, 1, {1, 2, kNone, 4}};
  EXPECT_NEAR(correlation(one, {4, 1, {2, 4, 9, 8}}), 1.0, 1e-12);
  EXPECT_NEAR(correlation(one, {4, 1, {-1, -2, 9, -4}}), -1.0, 1e-12);
  EXPECT_EQ(correlation(one, {4, 1, {3, 3, 9, 3}}), 0.0);
}

}  // namespace
}  // namespace tomofield::evaluate
