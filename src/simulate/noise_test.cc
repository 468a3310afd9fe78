#include "simulate/noise.h"

#include <gtest/gtest.h>

#include <cmath>
#include <vector>

#include "base/threads/parallel.h"

namespace tomofield::simulate {
namespace {

TEST(Noise, PoissonHasItsMomentsInBothRegimes) {
  for (const double mean : {0.0, 0.3, 4.0, 29.5, 30.5, 100.0, 12345.0}) {
    base::Random random(11);
    const int count = 200000;
    double sum = 0.0, squares = 0.0, cubes = 0.0;
    for (int i = 0; i < count; ++i) {
      const double d = static_cast<double>(poisson(mean, random)) - mean;
      sum += d;
      squares += d * d;
      cubes += d * d * d;
    }
    // Five standard errors; the fourth central moment is 3 m² + m, the sixth
    // 15 m³ + 25 m² + m.
    EXPECT_NEAR(sum / count, 0.0, 5.0 * std::sqrt(mean / count)) << mean;
    EXPECT_NEAR(squares / count, mean, 5.0 * std::sqrt((2.0 * mean * mean + mean) / count)) << mean;
    const double sixth = 15.0 * mean * mean * mean + 25.0 * mean * mean + mean;
    EXPECT_NEAR(cubes / count, mean, 5.0 * std::sqrt(sixth / count)) << mean;
  }
}

TEST(Noise, PoissonProbabilitiesAboveTheSwitch) {
  // The chance of each count of mean 40 against its formula: an error in the
  // rejection's bounds would show in the shape before it shows in the moments.
  base::Random random(5);
  const int count = 400000;
  std::vector<int> histogram(200);
  for (int i = 0; i < count; ++i) ++histogram.at(static_cast<std::size_t>(poisson(40.0, random)));
  double log_probability = -40.0;
  for (int k = 0; k < 90; ++k) {
    if (k > 0) log_probability += std::log(40.0 / k);
    const double expected = count * std::exp(log_probability);
    EXPECT_NEAR(histogram[static_cast<std::size_t>(k)], expected, 5.0 * std::sqrt(expected) + 4.0)
        << k;
  }
}

TEST(Noise, GaussianNoiseHasItsSpreadAndIgnoresTheThreads) {
  std::vector<float> one(200 * 300, 2.0f), two(200 * 300, 2.0f);
  const int threads = base::thread_count();
  base::set_thread_count(1);
  add_gaussian_noise(one, 300, 0.5, 9, 1000);
  base::set_thread_count(3);
  add_gaussian_noise(two, 300, 0.5, 9, 1000);
  base::set_thread_count(threads);
  EXPECT_EQ(one, two);
  double sum = 0.0, squares = 0.0;
  for (const float v : one) {
    sum += v - 2.0;
    squares += (v - 2.0) * (v - 2.0);
  }
  const double count = static_cast<double>(one.size());
  EXPECT_NEAR(sum / count, 0.0, 5.0 * 0.5 / std::sqrt(count));
  EXPECT_NEAR(squares / count, 0.25, 5.0 * 0.25 * std::sqrt(2.0 / count));
}

}  // namespace
}  // namespace tomofield::simulate
