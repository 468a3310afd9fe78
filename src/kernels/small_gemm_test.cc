#include "kernels/small_gemm.h"

#include <gtest/gtest.h>

#include "kernels/reference/reference_kernels.h"
#include "random_arrays.h"
#include "simd_targets.h"

namespace tomofield::kernels {
namespace {

using testing::expect_near;
using testing::for_each_simd_target;
using testing::random_floats;
using testing::to_double;

// The arrangement of the operands in memory. Every buffer starts one float past its allocation, so
// that no vector is aligned.
struct Arrangement {
  std::ptrdiff_t rows, depth, width;
  bool transposed_a = false;
  std::ptrdiff_t gap = 0;  // number of unused floats after each row
};

void compare_with_reference(const Arrangement& t) {
  SmallGemm g{.rows = t.rows, .depth = t.depth, .width = t.width};
  g.a_row = t.transposed_a ? 1 : t.depth + t.gap;
  g.a_col = t.transposed_a ? t.rows + t.gap : 1;
  g.b_row = g.c_row = t.width + t.gap;
  const auto a_size = t.transposed_a ? t.depth * g.a_col : t.rows * g.a_row;
  const auto a = random_floats(static_cast<std::size_t>(1 + a_size), 1);
  const auto b = random_floats(static_cast<std::size_t>(1 + t.depth * g.b_row), 2);
  auto c = random_floats(static_cast<std::size_t>(1 + t.rows * g.c_row), 3);

  const auto a2 = to_double(a), b2 = to_double(b);
  auto expected = to_double(c);
  reference::small_gemm(g, a2.data() + 1, b2.data() + 1, expected.data() + 1);
  g.a = a.data() + 1;
  g.b = b.data() + 1;
  g.c = c.data() + 1;
  small_gemm(g);
  // The gaps are compared too, because nothing beside C may change.
  expect_near(c, expected, 1e-6 * static_cast<double>(t.depth + 1));
}

TEST(SmallGemm, AgreesWithTheReferenceAtOddSizes) {
  for_each_simd_target([] {
    for (const std::ptrdiff_t rows : {1, 3, 7, 17, 33}) {
      for (const std::ptrdiff_t depth : {1, 5, 16, 33}) {
        for (const std::ptrdiff_t width : {1, 3, 7, 8, 12, 15, 16, 17, 24, 31, 33, 50}) {
          SCOPED_TRACE(::testing::Message() << rows << " x " << depth << " x " << width);
          compare_with_reference({rows, depth, width});
          compare_with_reference({rows, depth, width, true, 3});
        }
      }
    }
  });
}

// Uses depths and widths of whole and half vectors, as the ranks of factors are, and 24 adjacent
// rows.
TEST(SmallGemm, AgreesWithTheReferenceAtRanks) {
  for_each_simd_target([] {
    for (const std::ptrdiff_t rows : {1, 2, 6, 18, 24, 33}) {
      for (const std::ptrdiff_t depth : {8, 16, 24, 32, 40, 48, 56}) {
        for (const std::ptrdiff_t width : {1, 8, 16, 24, 40, 56}) {
          SCOPED_TRACE(::testing::Message() << rows << " x " << depth << " x " << width);
          compare_with_reference({rows, depth, width});
          compare_with_reference({rows, depth, width, false, 3});
          compare_with_reference({rows, depth, width, true, 3});
        }
      }
    }
  });
}

TEST(SmallGemm, EmptyProductsChangeNothing) {
  for_each_simd_target([] {
    compare_with_reference({4, 0, 9});
    compare_with_reference({0, 4, 9});
    compare_with_reference({4, 9, 0});
  });
}

}  // namespace
}  // namespace tomofield::kernels
