#include "base/gaussian_kernel.h"

#include <gtest/gtest.h>

#include <numeric>

namespace tomofield::base {
namespace {

TEST(GaussianKernel, IsASymmetricGaussianOfUnitSum) {
  const std::vector<float> kernel = gaussian_kernel(2.0, 3.5);
  ASSERT_EQ(kernel.size(), 15u);
  EXPECT_NEAR(std::accumulate(kernel.begin(), kernel.end(), 0.0), 1.0, 1e-6);
  for (std::size_t i = 0; i < kernel.size(); ++i) {
    const double at = (static_cast<double>(i) - 7.0) / 2.0;
    EXPECT_EQ(kernel[i], kernel[kernel.size() - 1 - i]);
    EXPECT_NEAR(kernel[i] / kernel[7], std::exp(-0.5 * at * at), 1e-6);
  }
}

}  // namespace
}  // namespace tomofield::base
