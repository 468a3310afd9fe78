#include "baseline/classical/ramp_filter.h"

#include <gtest/gtest.h>

#include <cmath>
#include <cstddef>
#include <numbers>
#include <vector>

#include "base/random.h"
#include "kernels/lanes.h"

namespace tomofield::baseline {
namespace {

using kernels::kLanes;

constexpr int kWidth = 37;
constexpr RampFilterOptions kPlain{.window = RampWindow::kRamp, .cutoff = 0.5, .falloff = 0.05};

std::vector<float> random_rays() {
  std::vector<float> rays(static_cast<std::size_t>(kWidth) * kLanes);
  base::Random random(3);
  for (float& ray : rays) ray = static_cast<float>(random.uniform(-1, 1));
  return rays;
}

// Returns equation 3.61 of Kak and Slaney for unit pixels.
double ramp_kernel(int n) {
  if (n == 0) return 0.25;
  return n % 2 == 0 ? 0.0 : -1.0 / std::pow(std::numbers::pi * n, 2);
}

TEST(RampFilter, IsADirectSumWithTheKernelWithoutWrapAround) {
  const std::vector<float> rays = random_rays();
  std::vector<float> filtered = rays;
  RampFilter(kPlain, kWidth).apply(filtered.data());
  for (int x = 0; x < kWidth; ++x) {
    for (int lane = 0; lane < kLanes; ++lane) {
      double expected = 0;
      for (int u = 0; u < kWidth; ++u) {
        expected += ramp_kernel(x - u) *
                    static_cast<double>(rays[static_cast<std::size_t>(u * kLanes + lane)]);
      }
      ASSERT_NEAR(filtered[static_cast<std::size_t>(x * kLanes + lane)], expected, 1e-6) << x;
    }
  }
}

double response_at(const RampFilter& filter, double f) {
  return static_cast<double>(
      filter.response()[static_cast<std::size_t>(std::lround(f * filter.length()))]);
}

TEST(RampFilter, ResponseIsTheFrequencyTimesTheWindow) {
  const int width = 500;
  RampFilterOptions options = kPlain;
  const RampFilter ramp(options, width);
  options.window = RampWindow::kHann;
  const RampFilter hann(options, width);
  options.window = RampWindow::kCosine;
  const RampFilter cosine(options, width);
  for (const double f : {0.05, 0.1, 0.25, 0.4}) {
    const double c = std::cos(std::numbers::pi * f);
    EXPECT_NEAR(response_at(ramp, f), f, 1e-3);
    EXPECT_NEAR(response_at(cosine, f), f * c, 1e-3);
    EXPECT_NEAR(response_at(hann, f), f * c * c, 1e-3);
  }
}

TEST(RampFilter, BeyondTheCutoffItFallsAsAGaussian) {
  RampFilterOptions options = kPlain;
  options.cutoff = 0.3;
  options.falloff = 0.05;
  const RampFilter filter(options, 500);
  EXPECT_NEAR(response_at(filter, 0.2), 0.2, 1e-3);
  EXPECT_NEAR(response_at(filter, 0.3), 0.3, 1e-3);
  EXPECT_NEAR(response_at(filter, 0.35), 0.3 * std::exp(-0.5), 1e-3);
  EXPECT_NEAR(response_at(filter, 0.45), 0.3 * std::exp(-4.5), 1e-3);
}

}  // namespace
}  // namespace tomofield::baseline
