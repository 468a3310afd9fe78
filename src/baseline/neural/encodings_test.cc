#include "baseline/neural/encodings.h"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>
#include <set>
#include <vector>

#include "random_arrays.h"

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

// A box of 8 × 6 × 5 with vertices every 2 pixels has 5 × 4 × 4 of them.
constexpr Point kBox = {8, 6, 5};
constexpr HashGridOptions kOneLevel = {.levels = 1, .coarsest = 2, .finest = 2, .table_bits = 10};
constexpr int kNumVertices = 5 * 4 * 4;

TEST(HashGrid, InterpolatesBetweenItsVertices) {
  const HashGrid grid(kBox, kOneLevel);
  ASSERT_EQ(grid.num_parameters(), 2u * kNumVertices);
  // Feature 0 is x + 2 y + 4 z at every vertex, which is linear. Feature 1 is its negative.
  std::vector<float> parameters;
  for (int v = 0; v < kNumVertices; ++v) {
    const float linear = static_cast<float>(2 * (v % 5) + 4 * (v / 5 % 4) + 8 * (v / 20));
    parameters.insert(parameters.end(), {linear, -linear});
  }
  const std::vector<Point> points = {{0.3f, 5.7f, 2.1f}, {4, 2, 4}, {8, 6, 5}, {7.9f, 0, 0.5f}};
  std::vector<float> features(points.size() * 2);
  grid.encode(points, parameters, features.data());
  for (std::size_t n = 0; n < points.size(); ++n) {
    const auto [x, y, z] = points[n];
    EXPECT_NEAR(features[2 * n], x + 2 * y + 4 * z, 1e-5) << n;
    EXPECT_NEAR(features[2 * n + 1], -(x + 2 * y + 4 * z), 1e-5) << n;
  }
}

TEST(HashGrid, LevelsGoFromCoarseToFineInGeometricSteps) {
  const HashGrid grid({32, 32, 32}, {.levels = 3, .coarsest = 16, .finest = 4, .table_bits = 12});
  EXPECT_EQ(grid.num_features(), 6);
  EXPECT_EQ(grid.num_parameters(), 2u * (3 * 3 * 3 + 5 * 5 * 5 + 9 * 9 * 9));
}

TEST(HashGrid, SharesEntriesWhereItHasMoreVertices) {
  HashGridOptions options = kOneLevel;
  options.table_bits = 5;
  const HashGrid grid(kBox, options);
  ASSERT_EQ(grid.num_parameters(), 2u * 32);
  // At a vertex only one entry counts. All entries are used, each by several vertices.
  std::set<float> values;
  std::vector<float> parameters;
  for (int entry = 0; entry < 32; ++entry)
    parameters.insert(parameters.end(), {static_cast<float>(entry), 0.0f});
  for (int v = 0; v < kNumVertices; ++v) {
    const Point vertex = {2.0f * static_cast<float>(v % 5), 2.0f * static_cast<float>(v / 5 % 4),
                          2.0f * static_cast<float>(v / 20)};
    float features[2];
    grid.encode(std::span(&vertex, 1), parameters, features);
    EXPECT_EQ(features[0], static_cast<float>(static_cast<int>(features[0])));
    values.insert(features[0]);
  }
  EXPECT_GT(values.size(), 20u);
}

TEST(HashGrid, AccumulateIsTheTransposeOfEncode) {
  for (const int table_bits : {5, 10}) {
    const HashGrid grid(kBox, {.levels = 3, .coarsest = 4, .finest = 1, .table_bits = table_bits});
    base::Random random(3);
    std::vector<Point> points(40);
    for (Point& p : points)
      for (std::size_t axis = 0; axis < 3; ++axis)
        p[axis] = static_cast<float>(random.uniform(0, static_cast<double>(kBox[axis])));
    const std::vector<float> parameters = testing::random_floats(grid.num_parameters(), 5);
    const std::vector<float> weights = testing::random_floats(points.size() * 6, 6);
    std::vector<float> features(weights.size()), gradient(parameters.size());
    grid.encode(points, parameters, features.data());
    grid.accumulate(points, weights.data(), gradient);
    const double forward = testing::dot(weights, features);
    const double backward = testing::dot(gradient, parameters);
    EXPECT_GT(std::abs(forward), 0.1);
    EXPECT_NEAR(forward, backward, 1e-4);
  }
}

}  // namespace
}  // namespace tomofield::baseline
