#include "kernels/column_interpolation.h"

#include <gtest/gtest.h>

#include <vector>

#include "kernels/lanes.h"
#include "kernels/reference/reference_kernels.h"
#include "kernels/row_interpolation.h"
#include "random_arrays.h"
#include "simd_targets.h"

namespace tomofield::kernels {
namespace {

using testing::random_floats;
using testing::to_double;

// Columns have more vertices than are used, which begin at the second. Buffers end with the last
// vertex in use.
constexpr int kStride = 20, kCount = 7;

struct Case {
  std::vector<float> fraction = random_floats(kLanes, 3);
  std::vector<int> lower;
  std::vector<float> vertices = random_floats(1 + kStride * (kCount - 1) + kLanes + 1, 1);
  std::vector<float> values = random_floats(kCount * kLanes, 2);
  Case() {
    for (float& f : fraction) f = (f + 1) / 2;
    for (int l = 0; l < kLanes; ++l) lower.push_back(l);
  }
  Columns columns() const { return {kCount, kStride, fraction.data()}; }
  LaneTaps taps() const { return {lower.data(), fraction.data()}; }
};

// For one column, the reference is the interpolation of rows of one float.
TEST(ColumnInterpolation, AgreesWithTheReference) {
  testing::for_each_simd_target([] {
    Case c;
    auto expected = to_double(c.values);
    const auto vertices = to_double(c.vertices);
    for (int n = 0; n < kCount; ++n) {
      std::vector<double> column(kLanes);
      reference::interpolate_rows(c.taps(), 1, vertices.data() + 1 + n * kStride, column.data());
      for (int l = 0; l < kLanes; ++l)
        expected[static_cast<std::size_t>(n * kLanes + l)] += column[static_cast<std::size_t>(l)];
    }
    interpolate_columns(c.columns(), c.vertices.data() + 1, c.values.data());
    testing::expect_near(c.values, expected, 3e-7);
  });
}

TEST(ColumnInterpolation, SpreadingIsItsAdjoint) {
  testing::for_each_simd_target([] {
    Case c;
    auto expected = to_double(c.vertices);
    const auto values = to_double(c.values);
    for (int n = 0; n < kCount; ++n)
      reference::spread_rows(c.taps(), 1, values.data() + n * kLanes,
                             expected.data() + 1 + n * kStride);
    spread_columns(c.columns(), c.values.data(), c.vertices.data() + 1);
    testing::expect_near(c.vertices, expected, 3e-7);
  });
}

TEST(ColumnInterpolation, NoColumnsAreNotTouched) {
  const float fraction[kLanes] = {};
  interpolate_columns({0, 1, fraction}, nullptr, nullptr);
  spread_columns({0, 1, fraction}, nullptr, nullptr);
}

}  // namespace
}  // namespace tomofield::kernels
