#pragma once

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <vector>

#include "base/random.h"

namespace tomofield::testing {

inline std::vector<float> random_floats(std::size_t size, std::uint64_t seed, double low = -1.0,
                                        double high = 1.0) {
  base::Random random(seed);
  std::vector<float> values(size);
  for (float& v : values) v = static_cast<float>(random.uniform(low, high));
  return values;
}

inline std::vector<double> to_double(const std::vector<float>& values) {
  return {values.begin(), values.end()};
}

/// Expects every element to be within `tolerance` of the expected one.
inline void expect_near(const std::vector<float>& found, const std::vector<double>& expected,
                        double tolerance) {
  ASSERT_EQ(found.size(), expected.size());
  std::size_t worst = 0;
  double largest = 0.0;
  for (std::size_t i = 0; i < found.size(); ++i) {
    const double error = std::abs(static_cast<double>(found[i]) - expected[i]);
    if (error > largest || std::isnan(error)) {
      largest = error;
      worst = i;
    }
    if (std::isnan(error)) break;
  }
  EXPECT_LE(largest, tolerance) << "at " << worst << ": " << found[worst] << " instead of "
                                << expected[worst];
}

inline double dot(const std::vector<float>& a, const std::vector<float>& b) {
  double sum = 0.0;
  for (std::size_t i = 0; i < a.size(); ++i) {
    sum += static_cast<double>(a[i]) * static_cast<double>(b[i]);
  }
  return sum;
}

}  // namespace tomofield::testing
