#include "tilt_series/resampling/band_limited_image.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <complex>
#include <numbers>
#include <vector>

#include "fourier/image_transform.h"
#include "microscope/line_extension.h"
#include "tilt_series/resampling/fill_invalid.h"

namespace tomofield::tilt_series {
namespace {

using fourier::RealTransform;
using microscope::LineExtension;

constexpr int kTaps = 8;
// There are 5/4 finer pixels for each pixel.
constexpr std::int64_t kFine = 5, kCoarse = 4;
constexpr double kFiner = static_cast<double>(kFine) / kCoarse;
// Number of pixels of its extension that lie before the image, so that the taps never wrap around.
constexpr std::int64_t kMargin_px = 16;
// Number of places between two pixels at which the weights of the taps are tabulated.
constexpr std::size_t kSteps = 1024;

using Weights = std::array<float, kTaps>;

// Computes the shape parameter of the kernel (Beatty et al. 2005, equation 5).
double kernel_shape() {
  const double reach = kTaps / kFiner * (kFiner - 0.5);
  return std::numbers::pi * std::sqrt(reach * reach - 0.8);
}

// Returns the kernel at a distance in finer pixels.
double kernel_at(double distance) {
  const double part = 2 * distance / kTaps;
  return part * part < 1.0 ? std::cyl_bessel_i(0.0, kernel_shape() * std::sqrt(1.0 - part * part))
                           : 0.0;
}

// Returns the Fourier transform of the kernel. `frequency` is in cycles a finer pixel, at most ½ /
// kFiner.
double kernel_transform(double frequency) {
  const double phase = std::numbers::pi * kTaps * frequency, shape = kernel_shape();
  const double root = std::sqrt(shape * shape - phase * phase);
  return kTaps * std::sinh(root) / root;
}

// Returns the weights of the taps around each of kSteps + 1 places between two pixels. The first
// tap lies kTaps / 2 − 1 pixels before the left one of them.
std::vector<Weights> weights_between_pixels() {
  std::vector<Weights> table(kSteps + 1);
  for (std::size_t step = 0; step < table.size(); ++step)
    for (int tap = 0; tap < kTaps; ++tap)
      table[step][static_cast<std::size_t>(tap)] =
          static_cast<float>(kernel_at(static_cast<double>(step) / kSteps - (tap - kTaps / 2 + 1)));
  return table;
}

// The taps along one axis that a place takes its value from.
struct Taps {
  std::int64_t first;
  Weights weights;
};

Taps taps_around(double place) {
  static const std::vector<Weights> table = weights_between_pixels();
  const double fine = kFiner * (place + kMargin_px);
  const auto left = static_cast<std::int64_t>(fine);
  const double step = kSteps * (fine - static_cast<double>(left));
  const std::size_t low = std::min(static_cast<std::size_t>(step), kSteps - 1);
  const auto part = static_cast<float>(step - static_cast<double>(low));
  Taps taps{left - kTaps / 2 + 1, {}};
  for (std::size_t tap = 0; tap < kTaps; ++tap)
    taps.weights[tap] = table[low][tap] + part * (table[low + 1][tap] - table[low][tap]);
  return taps;
}

// Returns a length that an image is extended to. kFine / kCoarse of it is even and fast as well.
std::int64_t extended_length(std::int64_t length) {
  const std::int64_t least = length + 2 * kMargin_px;
  return kCoarse * fourier::fast_even_size((least + kCoarse - 1) / kCoarse);
}

// Returns the place in an image's extension of what is at `i` in a LineExtension.
std::int64_t shifted(std::int64_t i, const LineExtension& line) {
  return (i + kMargin_px) % line.extended_length();
}

// Returns the extension of an image [y, x] less `mean`.
RealTransform::Image extended(const std::vector<float>& values, float mean,
                              const LineExtension& across, const LineExtension& along) {
  const std::int64_t width = across.extended_length();
  RealTransform::Image image(static_cast<std::size_t>(width * along.extended_length()));
  const auto row_of = [&](std::int64_t y) { return image.data() + shifted(y, along) * width; };
  for (std::int64_t y = 0; y < along.length(); ++y) {
    const float* from = values.data() + y * across.length();
    float* row = row_of(y);
    for (std::int64_t x = 0; x < width; ++x) {
      const auto& [pixels, weights] = across[x];
      row[shifted(x, across)] =
          weights[0] * (from[pixels[0]] - mean) + weights[1] * (from[pixels[1]] - mean);
    }
  }
  for (std::int64_t y = along.length(); y < along.extended_length(); ++y) {
    const auto& [rows, weights] = along[y];
    const float *first = row_of(rows[0]), *second = row_of(rows[1]);
    float* row = row_of(y);
    for (std::int64_t x = 0; x < width; ++x)
      row[x] = weights[0] * first[x] + weights[1] * second[x];
  }
  return image;
}

// Returns 1 / (size × kernel transform) of each frequency of a transform of length `size`. A half
// of the Nyquist frequency belongs to each of its signs.
std::vector<float> deconvolution(std::int64_t size) {
  std::vector<float> factors;
  for (std::int64_t k = 0; k < size; ++k) {
    const double frequency = std::abs(fourier::cycles_per_pixel(k, size));
    const double share = 2 * k == size ? 0.5 : 1.0;
    factors.push_back(static_cast<float>(
        share / (static_cast<double>(size) * kernel_transform(frequency / kFiner))));
  }
  return factors;
}

// Takes the transform of an image to that of a finer grid.
RealTransform::Spectrum refined(const RealTransform::Spectrum& spectrum,
                                const RealTransform& coarse, const RealTransform& fine) {
  RealTransform::Spectrum result(fine.spectrum_size());
  const std::vector<float> across = deconvolution(coarse.width());
  const std::vector<float> along = deconvolution(coarse.height());
  const auto put_row = [&](std::int64_t from_ky, std::int64_t to_ky) {
    const std::complex<float>* from = spectrum.data() + from_ky * coarse.half_width();
    std::complex<float>* to = result.data() + to_ky * fine.half_width();
    for (std::int64_t kx = 0; kx < coarse.half_width(); ++kx)
      to[kx] = from[kx] *
               (across[static_cast<std::size_t>(kx)] * along[static_cast<std::size_t>(from_ky)]);
  };
  const std::int64_t half = coarse.height() / 2, added = fine.height() - coarse.height();
  for (std::int64_t ky = 0; ky <= half; ++ky) put_row(ky, ky);
  for (std::int64_t ky = half; ky < coarse.height(); ++ky) put_row(ky, ky + added);
  return result;
}

float mean_of(const std::vector<float>& values) {
  double sum = 0.0;
  for (const float value : values) sum += static_cast<double>(value);
  return static_cast<float>(sum / static_cast<double>(values.size()));
}

}  // namespace

BandLimitedImage::BandLimitedImage(const MaskedImage& image) {
  const LineExtension across(image.width, extended_length(image.width));
  const LineExtension along(image.height, extended_length(image.height));
  const RealTransform coarse(across.extended_length(), along.extended_length());
  const RealTransform fine(coarse.width() * kFine / kCoarse, coarse.height() * kFine / kCoarse);
  RealTransform::Spectrum spectrum(coarse.spectrum_size());
  {
    const std::vector<float> values = fill_invalid(image);
    mean_ = mean_of(values);
    RealTransform::Image wide = extended(values, mean_, across, along);
    coarse.forward(wide, spectrum);
  }
  spectrum = refined(spectrum, coarse, fine);
  fine_ = RealTransform::Image(fine.image_size());
  fine.inverse(spectrum, fine_);
  fine_width_ = fine.width();
}

float BandLimitedImage::at(double x, double y) const {
  const Taps across = taps_around(x), along = taps_around(y);
  std::array<float, kTaps> columns{};
  const float* row = fine_.data() + along.first * fine_width_ + across.first;
  for (std::size_t j = 0; j < kTaps; ++j, row += fine_width_)
    for (std::size_t i = 0; i < kTaps; ++i) columns[i] += along.weights[j] * row[i];
  float sum = 0.0f;
  for (std::size_t i = 0; i < kTaps; ++i) sum += across.weights[i] * columns[i];
  return sum + mean_;
}

std::size_t BandLimitedImage::memory(double pixels) {
  // The finer grid and its transform, or the image, its extension and its transform.
  constexpr double kImages = 2 * kFiner * kFiner;
  return static_cast<std::size_t>(kImages * sizeof(float) * pixels);
}

}  // namespace tomofield::tilt_series
