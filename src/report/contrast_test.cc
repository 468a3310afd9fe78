#include "report/contrast.h"

#include <gtest/gtest.h>

#include <limits>

#include "base/random.h"
#include "scratch_directory.h"

namespace tomofield::report {
namespace {

TEST(Contrast, LiesAtThePercentilesOfFiniteValues) {
  std::vector<float> values;
  for (int i = 0; i <= 1000; ++i) values.push_back(static_cast<float>(i));
  values.push_back(std::numeric_limits<float>::quiet_NaN());
  const Contrast contrast = contrast_of(values);
  EXPECT_NEAR(contrast.black, 5, 1e-6);
  EXPECT_NEAR(contrast.white, 995, 1e-6);
}

TEST(Contrast, HasAWhiteAboveBlackWhateverTheValues) {
  for (const std::vector<float>& values : {std::vector<float>{}, std::vector<float>{7, 7, 7}}) {
    const Contrast contrast = contrast_of(values);
    EXPECT_LT(contrast.black, contrast.white);
  }
}

// One per cent of the voxels is gold, a hundred times as dense as the rest varies.
TEST(Contrast, IsNotThatOfBeads) {
  base::Random random(1);
  std::vector<float> values;
  for (int i = 0; i < 100000; ++i) values.push_back(static_cast<float>(random.normal()));
  const Contrast without = contrast_of(values);
  for (std::size_t i = 0; i < values.size(); i += 100) values[i] = -100.0f;
  const Contrast with = contrast_of(values);
  EXPECT_GT(with.black, -8);
  EXPECT_NEAR(with.white, without.white, 0.2);
}

TEST(Contrast, OfASpecimenThatFillsLittleIsItsOwn) {
  std::vector<float> values(10000, 0.0f);
  for (std::size_t i = 0; i < 100; ++i) values[97 * i] = 3.0f;
  EXPECT_EQ(contrast_of(values).white, 3.0);
}

TEST(Contrast, OfAVolumeIsThatOfItsMiddle) {
  const testing::ScratchDirectory directory;
  constexpr std::int64_t kWidth = 40, kHeight = 32, kDepth = 16;
  EXPECT_EQ(middle_size({kWidth, kHeight, kDepth}), (std::array<std::int64_t, 3>{30, 24, 8}));
  // The middle holds 0 to 1, and the rest 50.
  io::MrcWriter writer(directory / "v.mrc",
                       {.nx = kWidth, .ny = kHeight, .nz = kDepth, .labels = {}});
  for (std::int64_t z = 0; z < kDepth; ++z) {
    std::vector<float> section;
    for (std::int64_t y = 0; y < kHeight; ++y)
      for (std::int64_t x = 0; x < kWidth; ++x)
        section.push_back(z >= 4 && z < 12 && y >= 4 && y < 28 && x >= 5 && x < 35
                              ? static_cast<float>((x + y + z) % 101) / 100
                              : 50.0f);
    writer.write_section(z, section);
  }
  writer.close();
  const Contrast contrast = contrast_of(io::MrcReader(directory / "v.mrc"));
  EXPECT_GE(contrast.black, 0);
  EXPECT_LE(contrast.white, 1);
}

}  // namespace
}  // namespace tomofield::report
