#include "io/images/mrc_format.h"

#include <gtest/gtest.h>

#include <limits>

namespace tomofield::io {
namespace {

TEST(HalfFloat, EveryHalfSurvivesTheWayThroughFloat) {
  for (std::uint32_t bits = 0; bits < 0x10000; ++bits) {
    const auto half = static_cast<std::uint16_t>(bits);
    const float value = float_from_half(half);
    if (std::isnan(value)) {
      EXPECT_TRUE(std::isnan(float_from_half(half_from_float(value))));
    } else {
      EXPECT_EQ(half_from_float(value), half) << bits;
    }
  }
}

TEST(HalfFloat, KnownValues) {
  EXPECT_EQ(half_from_float(1.0f), 0x3c00);
  EXPECT_EQ(half_from_float(-2.0f), 0xc000);
  EXPECT_EQ(half_from_float(0x1p-24f), 0x0001);
  EXPECT_EQ(float_from_half(0x7bff), 65504.0f);
}

TEST(HalfFloat, RoundsToNearestTiesToEven) {
  const float step = 0x1p-10f;  // spacing of half floats between 1 and 2
  EXPECT_EQ(half_from_float(1.0f + 0.5f * step), 0x3c00);
  EXPECT_EQ(half_from_float(1.0f + 1.5f * step), 0x3c02);
  EXPECT_EQ(half_from_float(1.0f + 0.51f * step), 0x3c01);
  EXPECT_EQ(half_from_float(2.0f - 0.1f * step), 0x4000);   // carries into the exponent
  EXPECT_EQ(half_from_float(0x1p-14f - 0x1p-26f), 0x0400);  // leaves the subnormals
}

TEST(HalfFloat, FiniteValuesStayFinite) {
  EXPECT_EQ(half_from_float(1e30f), 0x7bff);
  EXPECT_EQ(half_from_float(-65519.9f), 0xfbff);
  EXPECT_EQ(half_from_float(std::numeric_limits<float>::infinity()), 0x7c00);
}

}  // namespace
}  // namespace tomofield::io
