#include "kernels/ray_samples.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <vector>

#include "kernels/reference/reference_kernels.h"
#include "random_arrays.h"
#include "simd_targets.h"

namespace tomofield::kernels {
namespace {

using testing::expect_near;
using testing::for_each_simd_target;
using testing::random_floats;
using testing::to_double;

constexpr LeafVertices kLeaf{.nx = 5, .nz = 7, .ny = 4};

// Returns pieces through the leaf from face to face, along an edge, within one cell, and backwards.
std::vector<RayPiece> pieces() {
  return {{0, 0.3f, 0, 4, 2.5f, 6, 0.7f, 11, 1},
          {0, 0.3f, 0, 4, 2.5f, 6, 0.25f, 12, 16},
          {0, 0, 0, 0, 0, 6, 1.5f, 13, 17},
          {4, 3, 6, -4, -3, -6, 0.5f, 14, 33},
          {1.2f, 2.1f, 3.4f, 0.3f, 0, 0.2f, 1, 15, 40},
          {4, 3, 0, 0, 0, 6, 2, 16, 7}};
}

TEST(RaySamples, RandomNumbersAreUniformAndDistinct) {
  double sum = 0, squares = 0, product = 0;
  constexpr int kCount = 100000;
  for (int i = 0; i < kCount; ++i) {
    const double u = random_unit(7, i);
    ASSERT_TRUE(u >= 0 && u < 1);
    sum += u;
    squares += u * u;
    product += u * random_unit(8, i);
  }
  // The tolerances are ten standard deviations of each mean.
  EXPECT_NEAR(sum / kCount, 0.5, 10 * 0.289 / std::sqrt(kCount));
  EXPECT_NEAR(squares / kCount, 1.0 / 3, 10 * 0.298 / std::sqrt(kCount));
  EXPECT_NEAR(product / kCount, 0.25, 10 * 0.22 / std::sqrt(kCount));
}

TEST(RaySamples, IntegralIsTheReference) {
  for_each_simd_target([] {
    const auto values = random_floats(kLeaf.size(), 1);
    for (const float beta : {0.0f, 5.0f}) {
      for (const RayPiece& piece : pieces()) {
        std::vector<float> densities(padded_samples(piece.num_samples));
        const double expected =
            reference::integrate_piece(kLeaf, {beta}, to_double(values).data(), piece);
        const double found = integrate_piece(kLeaf, {beta}, values.data(), piece, densities.data());
        EXPECT_NEAR(found, expected, 2e-5) << piece.num_samples;
        // The stored densities must have the returned sum.
        double sum = 0;
        for (int i = 0; i < piece.num_samples; ++i) sum += densities[static_cast<std::size_t>(i)];
        EXPECT_NEAR(sum * piece.segment_length, found, 2e-5);
      }
    }
  });
}

TEST(RaySamples, AdjointIsTheReference) {
  for_each_simd_target([] {
    const auto values = random_floats(kLeaf.size(), 1);
    for (const float beta : {0.0f, 5.0f}) {
      for (const RayPiece& piece : pieces()) {
        std::vector<float> densities(padded_samples(piece.num_samples));
        integrate_piece(kLeaf, {beta}, values.data(), piece, densities.data());
        auto gradient = random_floats(kLeaf.size(), 2);
        auto expected = to_double(gradient);
        const double grad_bias =
            spread_piece(kLeaf, {beta}, piece, densities.data(), -0.6f, gradient.data());
        const double expected_bias = reference::spread_piece(
            kLeaf, {beta}, to_double(values).data(), piece, -0.6f, expected.data());
        expect_near(gradient, expected, 2e-5);
        EXPECT_NEAR(grad_bias, expected_bias, 2e-5);
      }
    }
  });
}

}  // namespace
}  // namespace tomofield::kernels
