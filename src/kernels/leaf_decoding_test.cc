#include "kernels/leaf_decoding.h"

#include <gtest/gtest.h>

#include <cmath>
#include <vector>

#include "kernels/lanes.h"
#include "kernels/reference/reference_kernels.h"
#include "random_arrays.h"
#include "simd_targets.h"

namespace tomofield::kernels {
namespace {

using testing::expect_near;
using testing::for_each_simd_target;
using testing::random_floats;
using testing::to_double;

// Samples that are spread evenly over the vertices of one axis, both ends included.
struct Axis {
  std::vector<int> lower;
  std::vector<float> fraction;
  Axis(int num_vertices, int count) {
    for (int s = 0; s < count; ++s) {
      const double at =
          count == 1 ? 0.3 : static_cast<double>(s) * (num_vertices - 1) / (count - 1);
      lower.push_back(std::min(static_cast<int>(at), num_vertices - 2));
      fraction.push_back(static_cast<float>(at - lower.back()));
    }
  }
  AxisTaps taps() const { return {static_cast<int>(lower.size()), lower.data(), fraction.data()}; }
};

struct Leaf {
  int vertices_x, vertices_z, samples_x, samples_z;
  float beta;
  Axis x{vertices_x, samples_x}, z{vertices_z, samples_z};

  LeafPiece piece() const {
    return {.num_vertices_z = vertices_z,
            .x = x.taps(),
            .z = z.taps(),
            .stride_z = (samples_x + 2) * kLanes + 1,
            .activation = {beta}};
  }
  // Arrays have one float more in front, so that nothing is aligned.
  std::size_t num_values() const {
    return static_cast<std::size_t>(1 + vertices_x * vertices_z * kLanes);
  }
  std::size_t num_samples() const {
    return static_cast<std::size_t>(1 + piece().stride_z * samples_z);
  }
};

const std::vector<Leaf> kLeaves = {
    {2, 2, 1, 1, 0.0f},
    {2, 2, 1, 3, 5.0f},
    {3, 7, 17, 33, 0.0f},
    {7, 3, 17, 7, 5.0f},
    {17, 33, 33, 17, 1.0f},
    {5, 4, 33, 50, 100.0f},
    {17, 9, 5, 4, 5.0f},
    // These samples lie at vertices, at every other vertex, or at vertices of one axis alone.
    {33, 19, 33, 19, 5.0f},
    {17, 9, 9, 5, 0.0f},
    {9, 6, 9, 7, 5.0f},
};

TEST(LeafDecoding, AgreesWithTheReference) {
  for_each_simd_target([] {
    for (const Leaf& leaf : kLeaves) {
      const auto values = random_floats(leaf.num_values(), 1, -3.0, 3.0);
      auto samples = random_floats(leaf.num_samples(), 2);
      const auto values2 = to_double(values);
      auto expected = to_double(samples);
      reference::decode_leaf(leaf.piece(), values2.data() + 1, expected.data() + 1);
      decode_leaf(leaf.piece(), values.data() + 1, samples.data() + 1);
      // The gaps between rows are compared too: they must keep what they held.
      expect_near(samples, expected, 2e-6);
    }
  });
}

TEST(LeafDecoding, AdjointAgreesWithTheReference) {
  for_each_simd_target([] {
    for (const Leaf& leaf : kLeaves) {
      const auto values = random_floats(leaf.num_values(), 1, -3.0, 3.0);
      const auto grad_samples = random_floats(leaf.num_samples(), 2);
      std::vector<float> samples(leaf.num_samples());
      decode_leaf(leaf.piece(), values.data() + 1, samples.data() + 1);
      auto grad_values = random_floats(leaf.num_values(), 3);
      auto expected = to_double(grad_values);
      const auto values2 = to_double(values), grad2 = to_double(grad_samples);
      const double expected_bias = reference::decode_leaf_adjoint(
          leaf.piece(), values2.data() + 1, grad2.data() + 1, expected.data() + 1);
      const double bias = decode_leaf_adjoint(leaf.piece(), samples.data() + 1,
                                              grad_samples.data() + 1, grad_values.data() + 1);
      const double scale = std::sqrt(static_cast<double>(leaf.num_samples()));
      // act′ is computed from act, so its error is that of β act, relative to 1.
      const double tolerance = 4e-6 * (1.0 + static_cast<double>(leaf.beta));
      expect_near(grad_values, expected, tolerance);
      EXPECT_NEAR(bias, expected_bias, tolerance * scale);
    }
  });
}

// Checks that d/dt Σ g · decode(v + t d) = <adjoint(g), d>. Central differences of the double
// reference give the left side.
TEST(LeafDecoding, AdjointIsTheDerivative) {
  for_each_simd_target([] {
    for (const float beta : {0.0f, 5.0f}) {
      const Leaf leaf{5, 4, 9, 7, beta};
      const auto values = random_floats(leaf.num_values(), 1, -2.0, 2.0);
      const auto direction = random_floats(leaf.num_values(), 2);
      auto grad_samples = random_floats(leaf.num_samples(), 3);
      std::vector<float> samples(leaf.num_samples()), grad_values(leaf.num_values());
      decode_leaf(leaf.piece(), values.data() + 1, samples.data() + 1);
      decode_leaf_adjoint(leaf.piece(), samples.data() + 1, grad_samples.data() + 1,
                          grad_values.data() + 1);
      const auto objective = [&](double t) {
        auto moved = to_double(values);
        for (std::size_t i = 0; i < moved.size(); ++i) {
          moved[i] += t * static_cast<double>(direction[i]);
        }
        std::vector<double> decoded(leaf.num_samples());
        reference::decode_leaf(leaf.piece(), moved.data() + 1, decoded.data() + 1);
        double sum = 0.0;
        for (std::size_t i = 0; i < decoded.size(); ++i) {
          sum += decoded[i] * static_cast<double>(grad_samples[i]);
        }
        return sum;
      };
      const double expected = (objective(1e-4) - objective(-1e-4)) / 2e-4;
      EXPECT_NEAR(testing::dot(grad_values, direction), expected,
                  1e-4 * (1.0 + std::abs(expected)));
    }
  });
}

TEST(LeafDecoding, SoftplusIsItsLimitFarFromZero) {
  for_each_simd_target([] {
    // 19 values are no multiple of any vector. The last one must stay as it is.
    std::vector<float> values = {-1e30f, -1e4f, -40.0f, -20.0f, -1.0f, -0.0f, 0.0f,
                                 1e-6f,  0.5f,  1.0f,   20.0f,  40.0f, 1e4f,  1e30f,
                                 -0.3f,  0.3f,  2.0f,   -2.0f,  7.0f};
    const auto before = to_double(values);
    activate({5.0f}, values.data(), static_cast<std::ptrdiff_t>(values.size()) - 1);
    for (std::size_t i = 0; i + 1 < values.size(); ++i) {
      const double expected = reference::activation_value({5.0f}, before[i]);
      EXPECT_NEAR(values[i], expected, 3e-7 * std::abs(expected) + 1e-38) << before[i];
    }
    EXPECT_EQ(values.back(), 7.0f);
  });
}

TEST(LeafDecoding, ActivatingTheIdentityChangesNothing) {
  for_each_simd_target([] {
    std::vector<float> values = {-1.0f, 0.0f, 2.0f};
    activate({}, values.data(), 3);
    EXPECT_EQ(values, (std::vector<float>{-1.0f, 0.0f, 2.0f}));
  });
}

}  // namespace
}  // namespace tomofield::kernels
