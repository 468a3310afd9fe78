#include "microscope/view_filter.h"

#include <algorithm>
#include <cmath>
#include <complex>
#include <utility>

#include "base/check.h"
#include "microscope/exposure.h"

namespace tomofield::microscope {
namespace {

constexpr std::int64_t kSmallestMargin_px = 8;

// Returns the smallest and the largest defocus that a slope adds within an image.
std::pair<double, double> range_of(const DefocusSlope& slope, std::int64_t width,
                                   std::int64_t height) {
  const double half_A = std::abs(slope.x_A) * static_cast<double>(width - 1) / 2 +
                        std::abs(slope.y_A) * static_cast<double>(height - 1) / 2;
  return {slope.at_centre_A - half_A, slope.at_centre_A + half_A};
}

// Returns an extension whose two mirror images do not reach over each other into the line.
LineExtension extension_of(std::int64_t length, std::int64_t reach_px) {
  const std::int64_t margin_px = reach_px + kSmallestMargin_px;
  return {length, fourier::fast_even_size(length + 2 * margin_px)};
}

}  // namespace

std::int64_t reach_px(const ViewTransfer& view, std::int64_t width, std::int64_t height) {
  const auto [low_A, high_A] = range_of(view.slope, width, height);
  const double nyquist = 0.5 / view.pixel_size_A;
  const double reach_A =
      Ctf(view.optics, view.defocus).reach_A(nyquist, std::max(std::abs(low_A), std::abs(high_A)));
  return static_cast<std::int64_t>(std::ceil(reach_A / view.pixel_size_A));
}

ViewFilter::ViewFilter(std::int64_t width, std::int64_t height, const ViewTransfer& transfer)
    : view_(transfer),
      ctf_(transfer.optics, transfer.defocus),
      across_(extension_of(width, reach_px(transfer, width, height))),
      along_(extension_of(height, reach_px(transfer, width, height))),
      transform_(across_.extended_length(), along_.extended_length()) {
  const double nyquist = 0.5 / view_.pixel_size_A;
  const auto [low_A, high_A] = range_of(view_.slope, width, height);
  const double largest_step_A = 1.0 / (8.0 * ctf_.wavelength_A() * nyquist * nyquist);
  const std::int64_t num_steps = std::llround(std::ceil((high_A - low_A) / largest_step_A));
  first_defocus_A_ = low_A;
  num_defoci_ = num_steps + 1;
  if (num_steps > 0) defocus_step_A_ = (high_A - low_A) / static_cast<double>(num_steps);

  signal_.reserve(static_cast<std::size_t>(transform_.width() * transform_.height()));
  for (std::int64_t y = 0; y < transform_.height(); ++y) {
    for (std::int64_t x = 0; x < transform_.width(); ++x) {
      const double k = std::hypot(fourier::cycles_per_pixel(x, transform_.width()),
                                  fourier::cycles_per_pixel(y, transform_.height())) /
                       view_.pixel_size_A;
      signal_.push_back(
          static_cast<float>(signal_after(view_.exposure, k, view_.optics.voltage_kV)));
    }
  }
}

// Returns H_s at a frequency of the padded grid. Frequency ½ stands for −½ too, where astigmatism
// may give another value: their mean is the same at k and −k, so that real images stay real.
double ViewFilter::transfer(std::int64_t x, std::int64_t y, double more_defocus_A) const {
  const double kx = fourier::cycles_per_pixel(x, transform_.width()) / view_.pixel_size_A;
  const double ky = fourier::cycles_per_pixel(y, transform_.height()) / view_.pixel_size_A;
  double ctf = ctf_.value(kx, ky, more_defocus_A);
  if (2 * x == transform_.width() || 2 * y == transform_.height())
    ctf = (ctf + ctf_.value(kx, -ky, more_defocus_A)) / 2;
  const float signal = signal_[static_cast<std::size_t>(y * transform_.width() + x)];
  return static_cast<double>(signal) * (view_.is_flipped ? std::abs(ctf) : -ctf);
}

// Returns w_s at a pixel of the image. There is none beyond the last hat function.
float ViewFilter::weight_at(std::int64_t x, std::int64_t y, std::int64_t s) const {
  if (s >= num_defoci_) return 0.0f;
  if (num_defoci_ == 1) return 1.0f;
  const double defocus_A =
      view_.slope.at(static_cast<double>(x) + 0.5 - static_cast<double>(across_.length()) / 2,
                     static_cast<double>(y) + 0.5 - static_cast<double>(along_.length()) / 2);
  const double distance = std::abs(defocus_A - defocus_of(s)) / defocus_step_A_;
  return static_cast<float>(std::max(0.0, 1.0 - distance));
}

// Returns the extensions of w_s image, as real part, and of w_{s+1} image, as imaginary part.
ViewFilter::Image ViewFilter::extended_pair(std::span<const float> image, std::int64_t s) const {
  std::vector<std::complex<float>> weighted(image.size());
  for (std::int64_t y = 0; y < along_.length(); ++y)
    for (std::int64_t x = 0; x < across_.length(); ++x) {
      const auto i = static_cast<std::size_t>(y * across_.length() + x);
      weighted[i] = image[i] * std::complex<float>(weight_at(x, y, s), weight_at(x, y, s + 1));
    }
  Image extended;
  extended.reserve(static_cast<std::size_t>(transform_.width() * transform_.height()));
  for (std::int64_t y = 0; y < along_.extended_length(); ++y) {
    const LineExtension::Value& row = along_[y];
    for (std::int64_t x = 0; x < across_.extended_length(); ++x) {
      const LineExtension::Value& column = across_[x];
      std::complex<float> value = 0.0f;
      for (int j = 0; j < 2; ++j)
        for (int i = 0; i < 2; ++i)
          value += row.weights[j] * column.weights[i] *
                   weighted[static_cast<std::size_t>(row.pixels[j] * across_.length() +
                                                     column.pixels[i])];
      extended.push_back(value);
    }
  }
  return extended;
}

// Adds H_s A + H_{s+1} B to `sum`, where A and B are the transforms of the two real images whose
// sum A + iB is given. A is half the sum of the value at k and the conjugate of that at −k.
void ViewFilter::add_filtered_pair(const Image& pair, std::int64_t s, Image& sum) const {
  const std::int64_t width = transform_.width(), height = transform_.height();
  for (std::int64_t y = 0; y < height; ++y) {
    const std::int64_t opposite_y = (height - y) % height;
    for (std::int64_t x = 0; x < width; ++x) {
      const std::int64_t opposite_x = (width - x) % width;
      const auto i = static_cast<std::size_t>(y * width + x);
      const std::complex<float> here = pair[i];
      const std::complex<float> there =
          std::conj(pair[static_cast<std::size_t>(opposite_y * width + opposite_x)]);
      const std::complex<float> a = 0.5f * (here + there);
      const std::complex<float> b = std::complex<float>(0.0f, -0.5f) * (here - there);
      sum[i] += static_cast<float>(transfer(x, y, defocus_of(s))) * a;
      if (s + 1 < num_defoci_) sum[i] += static_cast<float>(transfer(x, y, defocus_of(s + 1))) * b;
    }
  }
}

// Adds the transpose of extended_pair() to `sum`.
void ViewFilter::add_folded_pair(const Image& pair, std::int64_t s, std::vector<float>& sum) const {
  std::vector<std::complex<float>> folded(sum.size());
  for (std::int64_t y = 0; y < along_.extended_length(); ++y) {
    const LineExtension::Value& row = along_[y];
    for (std::int64_t x = 0; x < across_.extended_length(); ++x) {
      const LineExtension::Value& column = across_[x];
      const std::complex<float> value = pair[static_cast<std::size_t>(y * transform_.width() + x)];
      for (int j = 0; j < 2; ++j)
        for (int i = 0; i < 2; ++i)
          folded[static_cast<std::size_t>(row.pixels[j] * across_.length() + column.pixels[i])] +=
              row.weights[j] * column.weights[i] * value;
    }
  }
  for (std::int64_t y = 0; y < along_.length(); ++y)
    for (std::int64_t x = 0; x < across_.length(); ++x) {
      const auto i = static_cast<std::size_t>(y * across_.length() + x);
      sum[i] += weight_at(x, y, s) * folded[i].real() + weight_at(x, y, s + 1) * folded[i].imag();
    }
}

std::vector<float> ViewFilter::apply(std::span<const float> image) const {
  TOMOFIELD_CHECK(std::ssize(image) == across_.length() * along_.length(), "size of the image");
  Image sum(static_cast<std::size_t>(transform_.width() * transform_.height()));
  for (std::int64_t s = 0; s < num_defoci_; s += 2) {
    Image pair = extended_pair(image, s);
    transform_.forward(pair);
    add_filtered_pair(pair, s, sum);
  }
  transform_.inverse(sum);
  std::vector<float> filtered;
  filtered.reserve(image.size());
  for (std::int64_t y = 0; y < along_.length(); ++y)
    for (std::int64_t x = 0; x < across_.length(); ++x)
      filtered.push_back(sum[static_cast<std::size_t>(y * transform_.width() + x)].real());
  return filtered;
}

std::vector<float> ViewFilter::apply_transpose(std::span<const float> image) const {
  TOMOFIELD_CHECK(std::ssize(image) == across_.length() * along_.length(), "size of the image");
  Image spectrum(static_cast<std::size_t>(transform_.width() * transform_.height()));
  for (std::int64_t y = 0; y < along_.length(); ++y)
    std::copy_n(image.begin() + y * across_.length(), across_.length(),
                spectrum.begin() + y * transform_.width());
  transform_.forward(spectrum);
  std::vector<float> result(image.size());
  for (std::int64_t s = 0; s < num_defoci_; s += 2) {
    Image pair = spectrum;
    for (std::int64_t y = 0; y < transform_.height(); ++y)
      for (std::int64_t x = 0; x < transform_.width(); ++x) {
        const double second = s + 1 < num_defoci_ ? transfer(x, y, defocus_of(s + 1)) : 0.0;
        pair[static_cast<std::size_t>(y * transform_.width() + x)] *= std::complex<float>(
            static_cast<float>(transfer(x, y, defocus_of(s))), static_cast<float>(second));
      }
    transform_.inverse(pair);
    add_folded_pair(pair, s, result);
  }
  return result;
}

}  // namespace tomofield::microscope
