#include "microscope/view_filter.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numbers>

#include "base/random.h"
#include "fourier/image_transform.h"
#include "microscope/exposure.h"

namespace tomofield::microscope {
namespace {

using Image = fourier::ImageTransform::Image;

std::vector<float> random_image(std::int64_t width, std::int64_t height, std::uint64_t seed) {
  base::Random random(seed);
  std::vector<float> image(static_cast<std::size_t>(width * height));
  for (float& value : image) value = static_cast<float>(random.normal());
  return image;
}

// Returns an image of Gaussian blobs with a standard deviation of 1.2 pixels, none of them nearer
// to the border than `margin` pixels.
std::vector<float> blobs(std::int64_t width, std::int64_t height, std::int64_t margin) {
  base::Random random(5);
  std::vector<float> image(static_cast<std::size_t>(width * height));
  for (int i = 0; i < 300; ++i) {
    const double x0 = random.uniform(double(margin), double(width - margin));
    const double y0 = random.uniform(double(margin), double(height - margin));
    const double peak = random.normal();
    for (std::int64_t y = 0; y < height; ++y)
      for (std::int64_t x = 0; x < width; ++x)
        image[y * width + x] += static_cast<float>(
            peak * std::exp(-(std::pow(double(x) - x0, 2) + std::pow(double(y) - y0, 2)) / 2.88));
  }
  return image;
}

double dot(std::span<const float> a, std::span<const float> b) {
  double sum = 0.0;
  for (std::size_t i = 0; i < a.size(); ++i) sum += double(a[i]) * double(b[i]);
  return sum;
}

double error_of(std::span<const float> image, std::span<const float> expected) {
  double error = 0.0, size = 0.0;
  for (std::size_t i = 0; i < image.size(); ++i) {
    error += std::pow(double(image[i]) - double(expected[i]), 2);
    size += std::pow(double(expected[i]), 2);
  }
  return std::sqrt(error / size);
}

ViewTransfer astigmatic_view() {
  ViewTransfer view;
  view.optics.b_factor_A2 = 50;
  view.defocus = {32000, 28000, 35, 20};
  view.exposure = 60;
  view.pixel_size_A = 10;
  return view;
}

TEST(SlopeOfTilt, HasMoreUnderfocusOnTheRightAtPositiveTilt) {
  const DefocusSlope slope = slope_of_tilt(60, 10, DefocusHand::kRight);
  EXPECT_NEAR(slope.at(100, 7), 1000 * std::sqrt(3), 1e-9);
  EXPECT_NEAR(slope_of_tilt(60, 10, DefocusHand::kLeft).at(100, 7), -1000 * std::sqrt(3), 1e-9);
  // A point of the plane Z = 0 at X is at x = X cos θ and at the height −X sin θ.
  const double tilt = 40 * std::numbers::pi / 180, x_px = 123;
  EXPECT_NEAR(slope_of_tilt(40, 5, DefocusHand::kRight).at(x_px * std::cos(tilt), 0),
              5 * x_px * std::sin(tilt), 1e-9);
}

TEST(SlopeOfTilt, OfARecordedImageIsThatOfItsAlignedPlaces) {
  const double c = 1.02 * std::cos(0.4), s = 1.02 * std::sin(0.4);
  const geometry::RawFromAligned map{c, -s, s, c, 12, -5};
  const DefocusSlope aligned = slope_of_tilt(50, 10, DefocusHand::kRight);
  const DefocusSlope raw = slope_of_tilt(50, 10, DefocusHand::kRight, map);
  const double x = 40, y = -30;
  EXPECT_NEAR(raw.at(c * x - s * y + 12, s * x + c * y - 5), aligned.at(x, y), 1e-9);
}

TEST(SpreadOfDetail, IsThatOfTheDefocusAndTheSphericalAberration) {
  ViewTransfer transfer{.optics = {.voltage_kV = 300}, .defocus = {3e4, 2e4, 0, 0}, .slope = {}};
  transfer.pixel_size_A = 10.0;
  transfer.optics.spherical_aberration_mm = 0.0;
  const double wavelength_A = electron_wavelength_A(300);
  EXPECT_NEAR(spread_px(transfer), wavelength_A * 3e4 / 200.0, 1e-9);
  transfer.optics.spherical_aberration_mm = 2.7;
  transfer.pixel_size_A = 0.1;  // λ³ Cs k³ is 26 µm at 5 cycles per Å
  transfer.defocus = {10.0, 10.0, 0, 0};
  EXPECT_NEAR(spread_px(transfer), 2.7e7 * std::pow(wavelength_A, 3) * 125.0 / 0.1, 20.0);
  // At the frequency where both cancel, a lower one is spread most.
  transfer.pixel_size_A = 1.0;
  transfer.defocus.u_A = transfer.defocus.v_A = 2.7e7 * wavelength_A * wavelength_A * 0.25;
  EXPECT_NEAR(spread_px(transfer), 2.7e7 * std::pow(wavelength_A, 3) * 0.25 / std::sqrt(27.0),
              1e-6);
}

TEST(LineExtension, KeepsTheLineAndHasNoStep) {
  const LineExtension extension(20, 64);
  std::vector<double> line, extended;
  for (int i = 0; i < 20; ++i) line.push_back(std::sin(0.2 * i) + 0.1 * i);
  for (std::int64_t i = 0; i < 64; ++i)
    extended.push_back(double(extension[i].weights[0]) * line[extension[i].pixels[0]] +
                       double(extension[i].weights[1]) * line[extension[i].pixels[1]]);
  for (int i = 0; i < 20; ++i) EXPECT_EQ(extended[i], line[i]);
  for (int i = 0; i < 64; ++i) EXPECT_LT(std::abs(extended[(i + 1) % 64] - extended[i]), 0.32) << i;
}

TEST(ViewFilter, HasAnExactTranspose) {
  for (const double tilt_deg : {0.0, 60.0}) {
    ViewTransfer view = astigmatic_view();
    view.slope = slope_of_tilt(tilt_deg, 10, DefocusHand::kRight, {0.9, -0.1, 0.1, 0.9, 3, 4});
    const ViewFilter filter(261, 46, view);
    EXPECT_EQ(filter.num_defoci() > 1, tilt_deg > 0);
    const auto a = random_image(261, 46, 1), b = random_image(261, 46, 2);
    const double forward = dot(filter.apply(a), b), back = dot(a, filter.apply_transpose(b));
    EXPECT_NEAR(forward / back, 1.0, 1e-5) << tilt_deg;
  }
}

// The power iteration for Hᵀ H shows the largest square of a singular value.
TEST(ViewFilter, HardlyAmplifiesAnyImage) {
  ViewTransfer view;
  view.defocus = {41000, 39000, 30, 0};
  view.pixel_size_A = 5;
  const ViewFilter filter(48, 48, view);
  auto image = random_image(48, 48, 4);
  double square = 0.0;
  for (int i = 0; i < 100; ++i) {
    const auto next = filter.apply_transpose(filter.apply(image));
    square = std::sqrt(dot(next, next) / dot(image, image));
    for (std::size_t j = 0; j < image.size(); ++j)
      image[j] = static_cast<float>(double(next[j]) / square);
  }
  EXPECT_LT(square, 1.1);
  EXPECT_GT(square, 0.9);
}

TEST(ViewFilter, TransfersNoFrequencyByMoreThanItsBound) {
  ViewTransfer view = astigmatic_view();
  view.slope.x_A = 100;
  const ViewFilter filter(64, 48, view);
  const Ctf ctf(view.optics, view.defocus);
  double before = 0.0;
  for (double k = 0.0; k < 0.7; k += 0.02) {  // cycles a pixel
    double largest = 0.0;
    for (int i = 0; i <= 10; ++i) {
      const double frequency = (k + 0.002 * i) / view.pixel_size_A;
      for (double angle = 0.0; angle < 3.1; angle += 0.1)
        for (const double x_px : {-31.5, 0.0, 31.5})
          largest = std::max(
              largest, std::abs(ctf.value(frequency * std::cos(angle), frequency * std::sin(angle),
                                          view.slope.at(x_px, 0))) *
                           signal_after(view.exposure, frequency, 300));
    }
    EXPECT_GE(filter.largest_transfer(k, k + 0.02), largest - 1e-4) << k;
    before = std::max(before, largest);
    EXPECT_LE(filter.largest_transfer(0.0, k + 0.02), before + 0.06) << k;
  }
}

TEST(ViewFilter, OfPureAbsorptionInFocusChangesNothing) {
  ViewTransfer view;
  view.optics = {300, 0, 1, 0};
  view.pixel_size_A = 10;
  const auto image = random_image(33, 40, 3);
  EXPECT_LT(error_of(ViewFilter(33, 40, view).apply(image), image), 1e-6);
}

TEST(ViewFilter, PassesTheMeanUnlessAContrastTransferTakesItAway) {
  ViewTransfer view;
  view.defocus = {30000, 30000, 0, 0};
  view.pixel_size_A = 10;
  EXPECT_FALSE(ViewFilter(33, 40, view).passes_mean());
  view.optics = without_phase_contrast(view.optics);
  view.exposure = 60.0;
  EXPECT_TRUE(ViewFilter(33, 40, view).passes_mean());
}

TEST(ViewFilter, KeepsAFlatImageFlat) {
  // Frequency 0 has the phase shift of 20 degrees and the amplitude contrast of 0.07.
  const double gain = std::sin(20 * std::numbers::pi / 180 + std::asin(0.07));
  for (const float value : ViewFilter(64, 40, astigmatic_view()).apply(std::vector(64 * 40, 2.0f)))
    EXPECT_NEAR(value, 2 * gain, 1e-5);
}

// Adds the transform of a column of the image, filtered with the defocus of the column alone. The
// grid is so large that nothing wraps around.
void add_filtered_column(const fourier::ImageTransform& transform, const Ctf& ctf,
                         const ViewTransfer& view, std::span<const float> image, std::int64_t width,
                         std::int64_t x, double more_defocus_A, Image& sum) {
  Image column(sum.size());
  for (std::int64_t y = 0; y < std::ssize(image) / width; ++y)
    column[y * transform.width() + x] = image[y * width + x];
  transform.forward(column);
  for (std::int64_t ky = 0; ky < transform.height(); ++ky)
    for (std::int64_t kx = 0; kx < transform.width(); ++kx) {
      const double fx = fourier::cycles_per_pixel(kx, transform.width()) / view.pixel_size_A;
      const double fy = fourier::cycles_per_pixel(ky, transform.height()) / view.pixel_size_A;
      const double h = -ctf.value(fx, fy, more_defocus_A) *
                       signal_after(view.exposure, std::hypot(fx, fy), view.optics.voltage_kV);
      sum[ky * transform.width() + kx] +=
          static_cast<float>(h) * column[ky * transform.width() + kx];
    }
}

// The specimen ends within the view, so that the extension is zero as it is in the reference.
TEST(ViewFilter, OfATiltedViewIsTheLocalTransferOfEachColumn) {
  constexpr std::int64_t kWidth = 512, kHeight = 36;
  ViewTransfer view;
  view.defocus = {41000, 39000, 30, 0};
  view.exposure = 30;
  view.pixel_size_A = 10;
  const auto image = blobs(kWidth, kHeight, 14);
  const ViewFilter flat(kWidth, kHeight, view);
  view.slope = slope_of_tilt(60, view.pixel_size_A, DefocusHand::kRight);
  const ViewFilter filter(kWidth, kHeight, view);

  const fourier::ImageTransform transform(540, 64);
  const Ctf ctf(view.optics, view.defocus);
  Image sum(540 * 64);
  for (std::int64_t x = 0; x < kWidth; ++x)
    add_filtered_column(transform, ctf, view, image, kWidth, x,
                        (static_cast<double>(x) + 0.5 - kWidth / 2.0) * 10 * std::sqrt(3), sum);
  transform.inverse(sum);
  std::vector<float> exact;
  for (std::int64_t y = 0; y < kHeight; ++y)
    for (std::int64_t x = 0; x < kWidth; ++x) exact.push_back(sum[y * 540 + x].real());

  const double error = error_of(filter.apply(image), exact);
  const double error_of_one_defocus = error_of(flat.apply(image), exact);
  RecordProperty("error", std::to_string(error));
  RecordProperty("error_of_one_defocus", std::to_string(error_of_one_defocus));
  EXPECT_LT(error, 0.05 * error_of_one_defocus);
  EXPECT_GT(error_of_one_defocus, 0.04);
}

TEST(ViewFilter, OfAFlippedViewHasNoNegativeFrequencies) {
  ViewTransfer view = astigmatic_view();
  const auto image = random_image(40, 40, 7);
  const auto unflipped =
      ViewFilter(40, 40, view).apply_transpose(ViewFilter(40, 40, view).apply(image));
  view.is_flipped = true;
  const ViewFilter flipped(40, 40, view);
  EXPECT_GT(dot(image, flipped.apply(image)), 0.0);
  // |H|² is the same with and without the flip.
  EXPECT_NEAR(dot(image, flipped.apply_transpose(flipped.apply(image))) / dot(image, unflipped),
              1.0, 0.05);
}

// Flipping makes |H|² of H², each place with its own defocus.
TEST(ViewFilter, CorrectsTheTransferOfEachPlace) {
  constexpr std::int64_t kWidth = 256, kHeight = 48;
  ViewTransfer view;
  view.defocus = {31000, 30000, 20, 0};
  view.pixel_size_A = 5;
  view.slope = slope_of_tilt(60, view.pixel_size_A, DefocusHand::kRight);
  const ViewFilter filter(kWidth, kHeight, view);
  const auto image = blobs(kWidth, kHeight, 14);
  const auto seen = filter.apply(image);
  view.is_flipped = true;
  const auto flipped = ViewFilter(kWidth, kHeight, view).apply(image);
  EXPECT_LT(error_of(filter.corrected(seen, CtfCorrection::kFlip), flipped), 0.05);
  EXPECT_GT(error_of(seen, flipped), 0.5);
  const double error = error_of(filter.corrected(seen, CtfCorrection::kWiener), image);
  EXPECT_LT(error, 0.9 * error_of(flipped, image));
  EXPECT_GT(dot(filter.corrected(seen, CtfCorrection::kMultiply), image), 0.0);
}

TEST(ViewFilter, PassesWhatTheDetectorPasses) {
  constexpr std::int64_t kWidth = 48, kHeight = 40;
  ViewTransfer view;
  view.optics = without_phase_contrast({});
  view.pixel_size_A = 10;
  // The detector's pixels are half as large, so that ¼ of theirs is Nyquist here.
  view.detector = std::make_shared<Detector>(Detector{{{0.0, 0.25, 0.5}, {1.0, 0.6, 0.0}}, 5.0});
  EXPECT_NEAR(view.detector->transfer(0.025), 0.8, 1e-12);
  EXPECT_NEAR(view.detector->transfer(0.2), 0.0, 1e-12);
  const ViewFilter filter(kWidth, kHeight, view);
  std::vector<float> wave(kWidth * kHeight), passed(kWidth * kHeight);
  for (std::int64_t i = 0; i < kWidth * kHeight; ++i) {  // four pixels a period
    wave[i] = static_cast<float>(std::cos(std::numbers::pi / 2 * (double(i % kWidth) + 0.5)));
    passed[i] = 0.8f * wave[i];
  }
  const std::vector<float> filtered = filter.apply(wave);
  double error = 0.0;
  for (std::int64_t i = 0; i < kWidth * kHeight; ++i)
    error = std::max(error, std::abs(double(filtered[i]) - double(passed[i])));
  EXPECT_LT(error, 2e-3);
}

}  // namespace
}  // namespace tomofield::microscope
