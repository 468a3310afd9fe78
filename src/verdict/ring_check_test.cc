#include "verdict/ring_check.h"

#include <gtest/gtest.h>

#include <cstdint>
#include <limits>
#include <vector>

#include "base/random.h"
#include "fourier/image_transform.h"

namespace tomofield::verdict {
namespace {

constexpr std::int64_t kSpectrumWidth = 136, kSpectrumHeight = 120;
constexpr int kSpectra = 8;

struct RingSeries {
  std::vector<evaluate::Image> views;
  std::vector<microscope::ViewTransfer> transfers;
};

microscope::ViewTransfer transfer_of(int view, double factor, double pixel_size_A) {
  microscope::ViewTransfer transfer;
  transfer.defocus.u_A = transfer.defocus.v_A = factor * (20000.0 + 1000.0 * view);
  transfer.pixel_size_A = pixel_size_A;
  return transfer;
}

// Returns views of a specimen whose spectrum is white, seen through the transfer, with white noise.
// Their transfers are given with the defocus times a factor.
RingSeries series_of(double signal, double factor, double pixel_size_A = 3.0) {
  base::Random random(11);
  const fourier::ImageTransform transform(kSpectrumWidth, kSpectrumHeight);
  RingSeries series;
  for (int view = 0; view < kSpectra; ++view) {
    const microscope::ViewTransfer truth = transfer_of(view, 1.0, pixel_size_A);
    const microscope::Ctf ctf(truth.optics, truth.defocus);
    fourier::ImageTransform::Image image(
        static_cast<std::size_t>(kSpectrumWidth * kSpectrumHeight));
    for (auto& value : image) value = static_cast<float>(signal * random.normal());
    transform.forward(image);
    for (std::int64_t y = 0; y < kSpectrumHeight; ++y)
      for (std::int64_t x = 0; x < kSpectrumWidth; ++x)
        image[static_cast<std::size_t>(y * kSpectrumWidth + x)] *= static_cast<float>(
            ctf.value(fourier::cycles_per_pixel(x, kSpectrumWidth) / pixel_size_A,
                      fourier::cycles_per_pixel(y, kSpectrumHeight) / pixel_size_A));
    transform.inverse(image);
    evaluate::Image seen{kSpectrumWidth, kSpectrumHeight, {}};
    for (const auto& value : image)
      seen.values.push_back(value.real() + static_cast<float>(random.normal()));
    seen.values[77] = std::numeric_limits<float>::quiet_NaN();
    series.views.push_back(std::move(seen));
    series.transfers.push_back(transfer_of(view, factor, pixel_size_A));
  }
  return series;
}

TEST(RingCheck, FindsTheDefocusOfTheRings) {
  for (const double factor : {1.0, 1.3, 0.7}) {
    const RingSeries series = series_of(2.0, factor);
    const auto check = check_rings(series.views, series.transfers);
    ASSERT_TRUE(check.has_value());
    EXPECT_NEAR(check->factor * factor, 1.0, 0.02);
    EXPECT_GT(check->agreement, 0.6);
    EXPECT_GT(check->rings, 5);
    EXPECT_EQ(check->given > 0.5 * check->agreement, factor == 1.0) << check->given;
    EXPECT_EQ(check->agreement - check->given > 5 * check->standard_error, factor != 1.0);
  }
}

TEST(RingCheck, NoiseHasNoRings) {
  const RingSeries series = series_of(0.0, 1.0);
  const auto check = check_rings(series.views, series.transfers);
  ASSERT_TRUE(check.has_value());
  EXPECT_LT(check->agreement, 0.25);
}

TEST(RingCheck, CountsFewerRingsInLargerPixels) {
  const RingSeries fine = series_of(0.0, 1.0), coarse = series_of(0.0, 1.0, 9.0);
  const double few = check_rings(coarse.views, coarse.transfers)->rings;
  EXPECT_LT(few, 2.5);
  EXPECT_NEAR(check_rings(fine.views, fine.transfers)->rings / few, 9, 1.5);
}

TEST(RingCheck, NeedsEnoughViewsWithADefocus) {
  RingSeries series = series_of(0.0, 1.0);
  for (int i = 0; i < 4; ++i) series.transfers[static_cast<std::size_t>(i)].defocus = {};
  EXPECT_FALSE(check_rings(series.views, series.transfers).has_value());
  EXPECT_FALSE(check_rings({}, {}).has_value());
}

}  // namespace
}  // namespace tomofield::verdict
