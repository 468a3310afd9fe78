#include "kernels/adam.h"

#include <gtest/gtest.h>

#include <cmath>

#include "kernels/reference/reference_kernels.h"
#include "random_arrays.h"
#include "simd_targets.h"

namespace tomofield::kernels {
namespace {

using testing::expect_near;
using testing::for_each_simd_target;
using testing::random_floats;
using testing::to_double;

TEST(Adam, AgreesWithTheReferenceOverManySteps) {
  for_each_simd_target([] {
    for (const std::size_t count : {1u, 3u, 7u, 17u, 33u, 100u}) {
      // The arrays start one float past the allocation, so they are unaligned. The floats before
      // and after them must stay as they are.
      auto p = random_floats(count + 2, 1), m = random_floats(count + 2, 3);
      auto v = random_floats(count + 2, 4, 0.0, 1.0);
      auto p2 = to_double(p), m2 = to_double(m), v2 = to_double(v);
      for (int t = 1; t <= 20; ++t) {
        auto g = random_floats(count + 2, static_cast<std::uint64_t>(100 + t));
        auto g2 = to_double(g);
        AdamStep step;
        step.rate_m = static_cast<float>(0.05 / (1 - std::pow(0.9, t)));
        step.rate_v = static_cast<float>(1 / std::sqrt(1 - std::pow(0.99, t)));
        const auto n = static_cast<std::ptrdiff_t>(count);
        adam_step(step, n, p.data() + 1, g.data() + 1, m.data() + 1, v.data() + 1);
        reference::adam_step(step, n, p2.data() + 1, g2.data() + 1, m2.data() + 1, v2.data() + 1);
        expect_near(g, g2, 0.0);
      }
      expect_near(p, p2, 1e-5);
      expect_near(m, m2, 1e-6);
      expect_near(v, v2, 1e-6);
    }
  });
}

TEST(Adam, FirstStepMovesByTheLearningRateWhateverTheGradientsSize) {
  for_each_simd_target([] {
    for (const float size : {1e-8f, 1e-3f, 1.0f, 1e6f}) {
      float p[3] = {0, 0, 0}, g[3] = {size, -size, 0}, m[3] = {}, v[3] = {};
      AdamStep step;
      step.rate_m = 0.05f / (1 - step.beta1);
      step.rate_v = 1 / std::sqrt(1 - step.beta2);
      adam_step(step, 3, p, g, m, v);
      EXPECT_NEAR(p[0], -0.05f, 1e-5f) << size;
      EXPECT_NEAR(p[1], 0.05f, 1e-5f) << size;
      EXPECT_EQ(p[2], 0.0f);
    }
  });
}

}  // namespace
}  // namespace tomofield::kernels
