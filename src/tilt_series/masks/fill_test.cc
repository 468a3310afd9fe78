#include "tilt_series/masks/fill.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <filesystem>
#include <numbers>

#include "base/random.h"
#include "io/images/mrc.h"
#include "shared_data.h"
#include "tilt_series/masks/straight_fill.h"

namespace tomofield::tilt_series {
namespace {

constexpr std::int64_t kSize = 40;

/// Noise, and one value in two corners as a rotated image has it.
MaskedImage with_fill(float fill) {
  base::Random random(1);
  MaskedImage image(kSize, kSize);
  for (std::int64_t y = 0; y < kSize; ++y) {
    for (std::int64_t x = 0; x < kSize; ++x) {
      const bool is_outside = x + 3 * y < 40 || (kSize - x) + 3 * (kSize - y) < 40;
      image.values[image.index(x, y)] =
          is_outside ? fill : static_cast<float>(100.0 + random.normal());
    }
  }
  return image;
}

TEST(ConstantFill, ExactlyTheFillIsMasked) {
  const MaskedImage before = with_fill(100.25f);
  MaskedImage image = before;
  const auto fill = std::count(before.values.begin(), before.values.end(), 100.25f);
  EXPECT_EQ(mask_fill(Contrast::kDark, &image), fill);
  for (std::size_t i = 0; i < image.values.size(); ++i) {
    EXPECT_EQ(image.valid[i] == 0, before.values[i] == 100.25f);
  }
}

TEST(ConstantFill, SmallRegionsAndRegionsWithoutACornerStay) {
  MaskedImage image = with_fill(100.25f);
  for (std::size_t i = 0; i < image.values.size(); ++i) {
    const auto x = static_cast<std::int64_t>(i) % kSize, y = static_cast<std::int64_t>(i) / kSize;
    if (image.values[i] == 100.25f) image.values[i] = static_cast<float>(i);
    if (x < 10 && y >= 15 && y < 25) image.values[i] = 7.0f;  // 100 pixels, at an edge
    if (x < 7 && y >= kSize - 9) image.values[i] = 8.0f;      // 63 in a corner
  }
  EXPECT_EQ(mask_fill(Contrast::kDark, &image), 0);
}

TEST(ConstantFill, SpaceWithoutSpecimenIsAMeasurement) {
  MaskedImage dark_is_empty = with_fill(0.0f);
  EXPECT_EQ(mask_fill(Contrast::kBright, &dark_is_empty), 0);
  MaskedImage bright_is_empty = with_fill(200.0f);
  EXPECT_EQ(mask_fill(Contrast::kDark, &bright_is_empty), 0);
  MaskedImage mean_fill = with_fill(100.25f);
  EXPECT_GT(mask_fill(Contrast::kBright, &mean_fill), 100);
}

TEST(ConstantFill, ViewsOfFewGreyLevelsAreMeasurements) {
  base::Random random(5);
  for (const double part : {0.1, 0.4, 0.5, 0.6, 0.9}) {
    MaskedImage image(kSize, kSize);
    for (float& value : image.values) value = random.uniform() < part ? 1.0f : 2.0f;
    image.values[0] = 3.0f;  // empty space, in bright or dark views
    image.values[image.values.size() / 2] = 0.0f;
    EXPECT_EQ(mask_fill(Contrast::kDark, &image), 0) << part;
    EXPECT_EQ(mask_fill(Contrast::kBright, &image), 0) << part;
  }
}

TEST(ConstantFill, StripsOfAShiftAreMaskedWhereNoiseBeginsBesideThem) {
  base::Random random(2);
  MaskedImage noisy(kSize, kSize), noiseless(kSize, kSize);
  for (std::int64_t y = 0; y < kSize; ++y) {
    for (std::int64_t x = 0; x < kSize; ++x) {
      if (x < 3) continue;
      noiseless.values[noiseless.index(x, y)] = static_cast<float>(x);
      if (y >= kSize - 2) continue;
      noisy.values[noisy.index(x, y)] = static_cast<float>(100.0 + random.normal());
    }
  }
  EXPECT_EQ(mask_fill(Contrast::kBright, &noisy), 3 * kSize + 2 * kSize - 6);
  EXPECT_EQ(mask_fill(Contrast::kBright, &noiseless), 0);
}

/// A frame of noise and structure, rotated and shifted, in dithered fill.
struct Rotated {
  double angle_deg = 5.0;
  double left = 0.0, right = 0.0, bottom = 0.0, top = 0.0;  // frame's offsets from the edges, px
  double fill = 1000.0;
  double specimen = 1000.0;  // grey of a broad band in the frame
};

constexpr std::int64_t kWidth = 180, kHeight = 220;

/// Pixels that `frame` leaves uncovered, by more than `by_px`.
bool is_uncovered(const Rotated& frame, std::int64_t x, std::int64_t y, double by_px) {
  const double angle = frame.angle_deg * std::numbers::pi / 180.0;
  const double dx = static_cast<double>(x) - 0.5 * (kWidth - 1);
  const double dy = static_cast<double>(y) - 0.5 * (kHeight - 1);
  const double u = dx * std::cos(angle) + dy * std::sin(angle);
  const double v = -dx * std::sin(angle) + dy * std::cos(angle);
  return u < -0.5 * kWidth + frame.left - by_px || u > 0.5 * kWidth - frame.right + by_px ||
         v < -0.5 * kHeight + frame.bottom - by_px || v > 0.5 * kHeight - frame.top + by_px;
}

double structure(std::int64_t x, std::int64_t y) {
  return 1200.0 + 300.0 * std::sin(0.07 * static_cast<double>(x)) + static_cast<double>(y);
}

MaskedImage render(const Rotated& frame) {
  constexpr std::array<double, 4> kDither{-60.0, 20.0, 60.0, -20.0};
  base::Random random(3);
  MaskedImage image(kWidth, kHeight);
  for (std::int64_t y = 0; y < kHeight; ++y) {
    for (std::int64_t x = 0; x < kWidth; ++x) {
      const bool is_band = std::abs(y - kHeight / 2) < 25;
      const double object = is_band ? frame.specimen : structure(x, y);
      const double dither = kDither[static_cast<std::size_t>((x + 2 * (y % 2)) % 4)];
      const double value =
          is_uncovered(frame, x, y, 0.0) ? frame.fill + dither : object + 90.0 * random.normal();
      image.values[image.index(x, y)] = static_cast<float>(value);
    }
  }
  return image;
}

/// All uncovered pixels are masked, and hardly any other.
void expect_masked(const Rotated& frame) {
  MaskedImage image = render(frame);
  mask_fill(Contrast::kDark, &image);
  std::int64_t num_missed = 0, num_lost = 0;
  for (std::int64_t y = 2; y < kHeight - 2; ++y) {
    for (std::int64_t x = 2; x < kWidth - 2; ++x) {
      const bool is_valid = image.valid[image.index(x, y)] != 0;
      num_missed += is_valid && is_uncovered(frame, x, y, 0.0);
      num_lost += !is_valid && !is_uncovered(frame, x, y, -6.0);
    }
  }
  EXPECT_LE(num_missed, 15) << "of the fill (its thin ends)";
  EXPECT_LE(num_lost, 15) << "of the image";
}

// Offsets of −30 put a side outside the picture.
TEST(StraightFill, OneToFourSidesAreMasked) {
  expect_masked({.angle_deg = 0.0, .left = 12.0, .right = -30, .bottom = -30, .top = -30});
  expect_masked({.angle_deg = 2.0, .left = 12.0, .right = -30, .bottom = 10.0, .top = -30});
  expect_masked({.angle_deg = -4.0, .left = 12.0, .right = 9.0, .bottom = 10.0, .top = -30});
  expect_masked({.angle_deg = 5.0, .left = 4.0, .right = 9.0, .bottom = 10.0, .top = 7.0});
  expect_masked({.angle_deg = -11.0, .left = 4.0, .right = 9.0, .bottom = 10.0, .top = 7.0});
}

TEST(StraightFill, AnyGreyOfTheFillIsFound) {
  for (const double fill : {200.0, 1100.0, 1300.0, 4000.0}) {
    SCOPED_TRACE(fill);
    expect_masked({.left = 4.0, .right = 9.0, .bottom = 10.0, .top = 7.0, .fill = fill});
  }
}

TEST(StraightFill, LargeImagesAreSampled) {
  const MaskedImage small = render({.left = 4.0, .right = 9.0, .bottom = 10.0, .top = 7.0});
  MaskedImage image(4 * kWidth, 4 * kHeight);
  base::Random random(5);
  for (std::int64_t y = 0; y < image.height; ++y) {
    for (std::int64_t x = 0; x < image.width; ++x) {
      image.values[image.index(x, y)] =
          small.values[small.index(x / 4, y / 4)] + static_cast<float>(20.0 * random.normal());
    }
  }
  const auto sides = find_straight_fill(Contrast::kDark, image);
  ASSERT_EQ(sides.size(), 4u);
  EXPECT_NEAR(sides[0].angle_rad * 180.0 / std::numbers::pi, 5.0, 0.25);
  EXPECT_NEAR(sides[0].offset_px, 4.0 * (4.0 - 0.5 * kWidth), 5.0);
  EXPECT_NEAR(sides[2].offset_px, 4.0 * (9.0 - 0.5 * kWidth), 5.0);
}

TEST(StraightFill, NothingIsMaskedWithoutFill) {
  const Rotated covers_all{.left = -30.0, .right = -30.0, .bottom = -30.0, .top = -30.0};
  MaskedImage image = render(covers_all);
  EXPECT_EQ(mask_fill(Contrast::kDark, &image), 0);
}

TEST(StraightFill, NoisySpaceBesideAStraightSpecimenStays) {
  base::Random random(4);
  MaskedImage vacuum(kWidth, kHeight), ice(kWidth, kHeight);
  for (std::int64_t y = 0; y < kHeight; ++y) {
    for (std::int64_t x = 0; x < kWidth; ++x) {
      const bool is_beyond = 10 * x + y < 600;
      vacuum.values[vacuum.index(x, y)] =
          static_cast<float>(is_beyond ? 5.0 + random.normal() : 300.0 + 40.0 * random.normal());
      ice.values[ice.index(x, y)] =
          static_cast<float>((is_beyond ? 900.0 : 600.0) + 40.0 * random.normal());
    }
  }
  EXPECT_EQ(mask_fill(Contrast::kBright, &vacuum), 0);
  EXPECT_EQ(mask_fill(Contrast::kDark, &ice), 0);
}

MaskedImage read_section(const io::MrcReader& stack, std::int64_t section) {
  MaskedImage image(stack.header().nx, stack.header().ny);
  stack.read_section(section, image.values);
  return image;
}

const std::filesystem::path kSharedData = testing::shared_data();

TEST(StraightFill, EveryViewOfTheExosomeSeriesHasItsFill) {
  const auto path = kSharedData / "exosome_cryo" / "exosome_341x480.ali";
  if (!std::filesystem::exists(path)) GTEST_SKIP() << path << " is not here";
  const io::MrcReader stack(path);
  for (std::int64_t section = 0; section < stack.header().nz; section += 3) {
    SCOPED_TRACE(section);
    const auto sides = find_straight_fill(Contrast::kDark, read_section(stack, section));
    ASSERT_GE(sides.size(), 3u);
    EXPECT_NEAR(sides.front().angle_rad * 180.0 / std::numbers::pi, 5.5, 1.6);
  }
}

TEST(StraightFill, NoViewOfTheDarkFieldSeriesHas) {
  for (const char* name : {"ta_film/area24.ali", "idp_haadf/haadf_tilt_raw.st",
                           "idp_haadf/haadf_tilt_tomviz_aligned.ali"}) {
    const auto path = kSharedData / name;
    if (!std::filesystem::exists(path)) GTEST_SKIP() << path << " is not here";
    const io::MrcReader stack(path);
    for (std::int64_t section = 0; section < stack.header().nz; ++section) {
      MaskedImage image = read_section(stack, section);
      EXPECT_EQ(mask_fill(Contrast::kBright, &image), 0) << name << ' ' << section;
    }
  }
}

}  // namespace
}  // namespace tomofield::tilt_series
