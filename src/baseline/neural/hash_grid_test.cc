#include "baseline/neural/hash_grid.h"

#include <gtest/gtest.h>

#include <cmath>
#include <set>
#include <vector>

#include "random_arrays.h"

namespace tomofield::baseline {
namespace {

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
