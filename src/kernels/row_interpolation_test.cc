#include "kernels/row_interpolation.h"

#include <gtest/gtest.h>

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

// Rows that are finer than the matrix's, equal to them, and coarser, in either order.
struct Rows {
  std::vector<int> lower;
  std::vector<float> fraction;
  Rows(int num_rows, double spacing, bool backwards) {
    for (int l = 0; l < kLanes; ++l) {
      const double at = 0.25 + spacing * (backwards ? kLanes - 1 - l : l);
      lower.push_back(std::min(static_cast<int>(at), num_rows - 2));
      fraction.push_back(static_cast<float>(std::min(at - lower.back(), 1.0)));
    }
  }
  LaneTaps taps() const { return {lower.data(), fraction.data()}; }
};

constexpr int kNumRows = 40;

// Calls check(taps, width) for rows and widths of all kinds.
template <typename Check>
void for_each_case(Check&& check) {
  for_each_simd_target([&] {
    for (const double spacing : {0.0, 0.3, 1.0, 1.0625, 2.5}) {
      for (const int width : {1, 3, 4, 7, 8, 16, 17, 33}) {
        SCOPED_TRACE(::testing::Message() << "spacing " << spacing << ", width " << width);
        check(Rows(kNumRows, spacing, false).taps(), width);
        check(Rows(kNumRows, spacing, true).taps(), width);
      }
    }
  });
}

// Buffers start one float past their allocation and end with the last element.
std::size_t matrix_size(int width) { return static_cast<std::size_t>(1 + kNumRows * width); }
std::size_t lanes_size(int width) { return static_cast<std::size_t>(1 + kLanes * width); }

TEST(RowInterpolation, AgreesWithTheReference) {
  for_each_case([](const LaneTaps& taps, int width) {
    const auto matrix = random_floats(matrix_size(width), 1);
    auto out = random_floats(lanes_size(width), 2);
    const auto matrix2 = to_double(matrix);
    auto expected = to_double(out);
    reference::interpolate_rows(taps, width, matrix2.data() + 1, expected.data() + 1);
    interpolate_rows(taps, width, matrix.data() + 1, out.data() + 1);
    expect_near(out, expected, 3e-7);
  });
}

TEST(LaneTransposition, GoesThereAndIsAddedBack) {
  for_each_simd_target([] {
    for (int width = 1; width <= 50; ++width) {
      SCOPED_TRACE(width);
      const auto lanes = random_floats(lanes_size(width), 1);
      const auto before = random_floats(lanes_size(width), 2);
      auto columns = before, sum = before;
      transpose_lanes(width, lanes.data() + 1, columns.data() + 1);
      EXPECT_EQ(columns[0], before[0]);
      for (int l = 0; l < kLanes; ++l) {
        for (int c = 0; c < width; ++c) {
          ASSERT_EQ(columns[static_cast<std::size_t>(1 + c * kLanes + l)],
                    lanes[static_cast<std::size_t>(1 + l * width + c)]);
        }
      }
      add_transposed(width, columns.data() + 1, sum.data() + 1);
      EXPECT_EQ(sum[0], before[0]);
      for (std::size_t i = 1; i < sum.size(); ++i) ASSERT_EQ(sum[i], before[i] + lanes[i]);
    }
  });
}

TEST(RowInterpolation, SpreadingIsItsAdjoint) {
  for_each_case([](const LaneTaps& taps, int width) {
    const auto grad = random_floats(lanes_size(width), 1);
    auto grad_matrix = random_floats(matrix_size(width), 2);
    const auto grad2 = to_double(grad);
    auto expected = to_double(grad_matrix);
    reference::spread_rows(taps, width, grad2.data() + 1, expected.data() + 1);
    spread_rows(taps, width, grad.data() + 1, grad_matrix.data() + 1);
    expect_near(grad_matrix, expected, 4e-6);
  });
}

}  // namespace
}  // namespace tomofield::kernels
