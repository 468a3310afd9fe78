#include "tilt_series/masks/subtract_beads.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <vector>

#include "base/random.h"
#include "microscope/view_filter.h"

namespace tomofield::tilt_series {
namespace {

constexpr std::int64_t kWidth = 120, kHeight = 96;
constexpr double kDiameter_px = 10.0, kBackground = 3.0, kDensity = 2.0;
// One bead is cut by the border, and two have fringes that overlap.
const std::vector<MaskDisc> kBeads{
    {30.3, 40.8, 12}, {52.1, 42.6, 12}, {95.0, 70.2, 12}, {1.5, 80, 12}};

microscope::ViewTransfer transfer() {
  microscope::ViewTransfer transfer;
  transfer.defocus = {.u_A = 41000.0, .v_A = 39000.0, .angle_deg = 30.0};
  transfer.pixel_size_A = 5.0;
  transfer.slope = {.x_A = 8.0};
  transfer.exposure = 20.0;
  return transfer;
}

// Returns the projection of the beads to a view with a border of this width around it.
std::vector<float> projection_of_beads(std::int64_t border) {
  constexpr int kParts = 8;  // of a pixel on each axis
  const std::int64_t width = kWidth + 2 * border, height = kHeight + 2 * border;
  std::vector<float> projection(static_cast<std::size_t>(width * height), 0.0f);
  for (const MaskDisc& bead : kBeads) {
    const MaskDisc around{bead.x_px + double(border), bead.y_px + double(border), kDiameter_px};
    for_pixels_in(around, width, height, [&](std::int64_t x, std::int64_t y) {
      double sum = 0.0;
      for (int i = 0; i < kParts * kParts; ++i) {
        const double dx = double(x) + (0.5 + i % kParts) / kParts - around.x_px;
        const double dy = double(y) + (0.5 + i / kParts) / kParts - around.y_px;
        sum += std::sqrt(std::max(kDiameter_px * kDiameter_px / 4 - dx * dx - dy * dy, 0.0));
      }
      projection[static_cast<std::size_t>(y * width + x)] +=
          static_cast<float>(2 * kDensity * sum / (kParts * kParts));
    });
  }
  return projection;
}

// Returns a view of beads as the microscope makes it, on a constant background. The middles of
// beads are saturated.
MaskedImage view_of_beads() {
  constexpr std::int64_t kBorder = 40;  // a filter mirrors what is beyond
  const std::int64_t width = kWidth + 2 * kBorder, height = kHeight + 2 * kBorder;
  const std::vector<float> wide =
      microscope::ViewFilter(width, height, transfer()).apply(projection_of_beads(kBorder));
  MaskedImage image(kWidth, kHeight);
  for (std::int64_t y = 0; y < kHeight; ++y)
    for (std::int64_t x = 0; x < kWidth; ++x)
      image.values[image.index(x, y)] =
          wide[static_cast<std::size_t>((y + kBorder) * width + x + kBorder)];
  for (const MaskDisc& bead : kBeads)
    for_pixels_in({bead.x_px, bead.y_px, kDiameter_px / 2}, kWidth, kHeight,
                  [&](std::int64_t x, std::int64_t y) {
                    float& value = image.values[image.index(x, y)];
                    value = std::min(value, 8.0f);
                  });
  for (float& value : image.values) value += static_cast<float>(kBackground);
  return image;
}

// Returns the largest distance from the background of the pixels farther than 0.7 diameters from
// all beads.
double largest_fringe(const MaskedImage& image) {
  double largest = 0.0;
  for (std::int64_t y = 0; y < kHeight; ++y)
    for (std::int64_t x = 0; x < kWidth; ++x) {
      const bool is_beside = std::ranges::all_of(kBeads, [&](const MaskDisc& bead) {
        return std::hypot(double(x) + 0.5 - bead.x_px, double(y) + 0.5 - bead.y_px) >
               0.7 * kDiameter_px;
      });
      if (is_beside)
        largest =
            std::max(largest, std::abs(double(image.values[image.index(x, y)]) - kBackground));
    }
  return largest;
}

TEST(SubtractBeads, FringesAreGone) {
  MaskedImage image = view_of_beads();
  const double before = largest_fringe(image);
  ASSERT_GT(before, 1.0);
  subtract_beads(kBeads, kDiameter_px, transfer(), &image);
  EXPECT_LT(largest_fringe(image), 0.06 * before);
}

TEST(SubtractBeads, PlacesAndDiametersMayBeALittleWrong) {
  MaskedImage image = view_of_beads();
  const double before = largest_fringe(image);
  std::vector<MaskDisc> discs = kBeads;
  for (MaskDisc& disc : discs) disc.x_px += 0.4, disc.y_px -= 0.3;
  const std::vector<MaskDisc> left = subtract_beads(discs, 0.92 * kDiameter_px, transfer(), &image);
  EXPECT_LT(largest_fringe(image), 0.15 * before);
  for (std::size_t i = 0; i < 3; ++i) {  // the last one is cut by the border
    EXPECT_NEAR(left[i].x_px, kBeads[i].x_px, 0.1);
    EXPECT_NEAR(left[i].y_px, kBeads[i].y_px, 0.1);
    EXPECT_LT(left[i].radius_px, kBeads[i].radius_px);
  }
}

TEST(SubtractBeads, PlacesWithoutBeadsHardlyChange) {
  base::Random random(3, 0);
  MaskedImage noise(kWidth, kHeight);
  for (float& value : noise.values) value = static_cast<float>(random.uniform(-1.0, 1.0));
  MaskedImage image = noise;
  subtract_beads(kBeads, kDiameter_px, transfer(), &image);
  double change = 0.0;
  for (std::size_t i = 0; i < image.values.size(); ++i)
    change += std::pow(double(image.values[i]) - double(noise.values[i]), 2);
  // Each fitted density explains the noise of one pixel, whose variance is 1/3, and its own core.
  EXPECT_LT(change, 10.0);
}

TEST(SubtractBeads, AViewWithoutBeadsStays) {
  const MaskedImage before = view_of_beads();
  MaskedImage image = before;
  subtract_beads({}, kDiameter_px, transfer(), &image);
  EXPECT_EQ(image.values, before.values);
}

TEST(SubtractBeads, PixelsThatAreNoMeasurementsStay) {
  MaskedImage image = view_of_beads();
  const std::size_t at = image.index(44, 45);
  image.valid[at] = kNoMeasurement;
  image.values[at] = 0.0f;
  subtract_beads(kBeads, kDiameter_px, transfer(), &image);
  EXPECT_EQ(image.values[at], 0.0f);
}

}  // namespace
}  // namespace tomofield::tilt_series
