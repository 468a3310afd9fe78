#include "fourier/real_transform.h"

#include <gtest/gtest.h>

#include <complex>
#include <numbers>

#include "base/random.h"

namespace tomofield::fourier {
namespace {

constexpr std::int64_t kWidth = 12, kHeight = 10;

RealTransform::Image random_image() {
  base::Random random(3);
  RealTransform::Image image(kWidth * kHeight);
  for (float& value : image) value = static_cast<float>(random.normal());
  return image;
}

TEST(RealTransform, IsTheSumOfItsDefinition) {
  const RealTransform transform(kWidth, kHeight);
  RealTransform::Image image = random_image();
  RealTransform::Spectrum spectrum(transform.spectrum_size());
  transform.forward(image, spectrum);
  for (std::int64_t ky = 0; ky < kHeight; ++ky)
    for (std::int64_t kx = 0; kx < transform.half_width(); ++kx) {
      std::complex<double> sum = 0;
      for (std::int64_t y = 0; y < kHeight; ++y)
        for (std::int64_t x = 0; x < kWidth; ++x)
          sum += static_cast<double>(image[static_cast<std::size_t>(y * kWidth + x)]) *
                 std::polar(1.0, -2 * std::numbers::pi *
                                     (static_cast<double>(kx * x) / kWidth +
                                      static_cast<double>(ky * y) / kHeight));
      const auto found = spectrum[static_cast<std::size_t>(ky * transform.half_width() + kx)];
      EXPECT_NEAR(std::abs(std::complex<double>(found) - sum), 0.0, 1e-4) << kx << ", " << ky;
    }
}

TEST(RealTransform, IsUndoneButForAFactor) {
  const RealTransform transform(kWidth, kHeight);
  RealTransform::Image image = random_image(), back(transform.image_size());
  RealTransform::Spectrum spectrum(transform.spectrum_size());
  transform.forward(image, spectrum);
  transform.inverse(spectrum, back);
  for (std::size_t i = 0; i < image.size(); ++i)
    EXPECT_NEAR(back[i] / (kWidth * kHeight), image[i], 1e-5);
}

}  // namespace
}  // namespace tomofield::fourier
