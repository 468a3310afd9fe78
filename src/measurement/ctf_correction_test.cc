#include "measurement/ctf_correction.h"

#include <gtest/gtest.h>

#include <cmath>
#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "base/random.h"

namespace tomofield::measurement {
namespace {

constexpr std::int64_t kWidth = 40, kHeight = 24;

// A view of random pixels, of which those of one column do not count.
Measurement series_of_one_view() {
  Measurement series;
  series.rays = std::make_shared<SlabViews>(
      SlabViews::Shape{1, kWidth, kHeight, 0, kHeight}, 1.0,
      [](std::size_t, std::span<float> image, std::span<std::uint8_t> valid) {
        base::Random random(3);
        for (std::size_t i = 0; i < image.size(); ++i) {
          valid[i] = i % kWidth == 7 ? 0 : 1;
          image[i] = valid[i] ? static_cast<float>(random.normal()) : 0.0f;
        }
      },
      "");
  microscope::ViewTransfer transfer;
  transfer.defocus = {30000, 30000, 0, 0};
  transfer.pixel_size_A = 8;
  series.transfers = {transfer};
  return series;
}

TEST(CorrectCtf, ChangesTheRaysThatCountAndNoOthers) {
  Measurement series = series_of_one_view();
  const auto before = series.rays;
  correct_ctf(microscope::CtfCorrection::kFlip, series);
  EXPECT_TRUE(series.transfers.empty());
  double change = 0.0;
  for (std::int64_t y = 0; y < kHeight; ++y)
    for (std::int64_t x = 0; x < kWidth; ++x) {
      EXPECT_EQ(series.rays->counts(0, x, y), x != 7);
      change += static_cast<double>(std::abs(series.rays->ray(0, x, y) - before->ray(0, x, y)));
    }
  EXPECT_GT(change, 0.1 * kWidth * kHeight);
  EXPECT_TRUE(before->counts(0, 8, 0));
}

TEST(CorrectCtf, LeavesViewsAloneWhosePhasesWereFlippedAlready) {
  Measurement series = series_of_one_view();
  series.transfers.front().is_flipped = true;
  const auto before = series.rays;
  correct_ctf(microscope::CtfCorrection::kFlip, series);
  for (std::int64_t y = 0; y < kHeight; ++y)
    for (std::int64_t x = 0; x < kWidth; ++x)
      EXPECT_NEAR(series.rays->ray(0, x, y), before->ray(0, x, y), 1e-5);
}

}  // namespace
}  // namespace tomofield::measurement
