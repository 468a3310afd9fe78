#include "microscope/view_filter.h"

#include <algorithm>
#include <cmath>
#include <complex>
#include <numbers>
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

// A filter keeps at most so many transfers: 1 MiB.
constexpr std::int64_t kMostKept = std::int64_t{1} << 18;

// The sine is interpolated to 3·10⁻⁷.
constexpr std::size_t kStepsOfTables = 4096;

// Returns the sine of an angle in turns, from 0 to 1.
float sine_of_turns(double turns) {
  static const InterpolatedTable table(1.0, kStepsOfTables,
                                       [](double t) { return std::sin(2 * std::numbers::pi * t); });
  return table(turns);
}

std::vector<double> frequencies(std::int64_t size, double pixel_size_A) {
  std::vector<double> k;
  for (std::int64_t i = 0; i < size; ++i)
    k.push_back(fourier::cycles_per_pixel(i, size) / pixel_size_A);
  return k;
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
      transform_(across_.extended_length(), along_.extended_length()),
      kx_(frequencies(transform_.width(), transfer.pixel_size_A)),
      ky_(frequencies(transform_.height(), transfer.pixel_size_A)),
      signal_(0.5 / (transfer.pixel_size_A * transfer.pixel_size_A), kStepsOfTables,
              [&](double k2) {
                return ctf_.envelope(k2) *
                       signal_after(transfer.exposure, std::sqrt(k2), transfer.optics.voltage_kV);
              }) {
  const double nyquist = 0.5 / view_.pixel_size_A;
  const auto [low_A, high_A] = range_of(view_.slope, width, height);
  const double largest_step_A = 1.0 / (8.0 * ctf_.wavelength_A() * nyquist * nyquist);
  const std::int64_t num_steps = std::llround(std::ceil((high_A - low_A) / largest_step_A));
  first_defocus_A_ = low_A;
  num_defoci_ = num_steps + 1;
  if (num_steps > 0) defocus_step_A_ = (high_A - low_A) / static_cast<double>(num_steps);
  keep_transfers();
}

// Returns H_s at a frequency of the padded grid. Frequency ½ stands for −½ too, where astigmatism
// may give another value: their mean is the same at k and −k, so that real images stay real.
float ViewFilter::computed_transfer(const Frequency& k, std::int64_t s) const {
  const double kx = kx_[static_cast<std::size_t>(k.x)], ky = ky_[static_cast<std::size_t>(k.y)];
  const auto sine = [&](double of_ky) {
    // An angle is that many turns, of which a whole number makes no difference.
    constexpr double kWholeTurns = 1 << 20;
    const double turns = ctf_.turns(kx, of_ky, defocus_of(s)) + kWholeTurns;
    return sine_of_turns(turns - static_cast<double>(static_cast<std::int64_t>(turns)));
  };
  float ctf = sine(ky);  // −CTF
  if (2 * k.x == transform_.width() || 2 * k.y == transform_.height()) ctf = (ctf + sine(-ky)) / 2;
  return signal_(kx * kx + ky * ky) * (view_.is_flipped ? std::abs(ctf) : ctf);
}

// Calls a function with kx, ky and the place of each frequency k, and the place of −k. Of the two,
// it visits one.
template <typename Visit>
void ViewFilter::for_opposite_frequencies(const Visit& visit) const {
  const std::int64_t width = transform_.width(), height = transform_.height();
  std::size_t number = 0;
  for (std::int64_t y = 0; 2 * y <= height; ++y) {
    const bool is_own_opposite = 2 * y % height == 0;
    const std::int64_t opposite_y = (height - y) % height;
    for (std::int64_t x = 0; x < (is_own_opposite ? width / 2 + 1 : width); ++x) {
      const std::int64_t opposite_x = (width - x) % width;
      visit(Frequency{x, y, static_cast<std::size_t>(y * width + x),
                      static_cast<std::size_t>(opposite_y * width + opposite_x), number++});
    }
  }
}

// Computes the transfers once, if they do not take much memory.
void ViewFilter::keep_transfers() {
  const std::int64_t frequencies = transform_.width() * (transform_.height() / 2 + 1);
  if (frequencies * num_defoci_ > kMostKept) return;
  std::vector<float> transfers;
  for (std::int64_t s = 0; s < num_defoci_; ++s)
    for_opposite_frequencies(
        [&](const Frequency& k) { transfers.push_back(computed_transfer(k, s)); });
  transfers_ = std::move(transfers);
}

float ViewFilter::transfer(const Frequency& k, std::int64_t s) const {
  if (transfers_.empty()) return computed_transfer(k, s);
  const std::size_t of_a_defocus = transfers_.size() / static_cast<std::size_t>(num_defoci_);
  return transfers_[static_cast<std::size_t>(s) * of_a_defocus + k.number];
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
  const auto width = static_cast<std::size_t>(transform_.width());
  Image wide;  // extended along x
  wide.reserve(width * static_cast<std::size_t>(along_.length()));
  for (std::int64_t y = 0; y < along_.length(); ++y) {
    const auto* row = weighted.data() + y * across_.length();
    for (std::int64_t x = 0; x < across_.extended_length(); ++x) {
      const auto& [pixels, weights] = across_[x];
      wide.push_back(weights[0] * row[pixels[0]] + weights[1] * row[pixels[1]]);
    }
  }
  Image extended;
  extended.reserve(width * static_cast<std::size_t>(transform_.height()));
  for (std::int64_t y = 0; y < along_.extended_length(); ++y) {
    const auto& [rows, weights] = along_[y];
    const auto* first = wide.data() + static_cast<std::size_t>(rows[0]) * width;
    const auto* second = wide.data() + static_cast<std::size_t>(rows[1]) * width;
    for (std::size_t x = 0; x < width; ++x)
      extended.push_back(weights[0] * first[x] + weights[1] * second[x]);
  }
  return extended;
}

// Adds H_s A + H_{s+1} B to `sum`, where A and B are the transforms of the two real images whose
// sum A + iB is given. A is half the sum of the value at k and the conjugate of that at −k, where
// the transfer is the same.
void ViewFilter::add_filtered_pair(const Image& pair, std::int64_t s, Image& sum) const {
  for_opposite_frequencies([&](const Frequency& k) {
    const std::complex<float> here = pair[k.at], there = std::conj(pair[k.opposite]);
    std::complex<float> filtered = transfer(k, s) * 0.5f * (here + there);
    if (s + 1 < num_defoci_)
      filtered += transfer(k, s + 1) * std::complex<float>(0.0f, -0.5f) * (here - there);
    sum[k.at] += filtered;
    if (k.at != k.opposite) sum[k.opposite] += std::conj(filtered);
  });
}

// Adds the transpose of extended_pair() to `sum`.
void ViewFilter::add_folded_pair(const Image& pair, std::int64_t s, std::vector<float>& sum) const {
  const auto width = static_cast<std::size_t>(transform_.width());
  Image wide(width * static_cast<std::size_t>(along_.length()));  // folded along y
  for (std::int64_t y = 0; y < along_.extended_length(); ++y) {
    const LineExtension::Value& row = along_[y];
    for (int j = 0; j < 2; ++j) {
      auto* to = wide.data() + static_cast<std::size_t>(row.pixels[j]) * width;
      const auto* from = pair.data() + static_cast<std::size_t>(y) * width;
      for (std::size_t x = 0; x < width; ++x) to[x] += row.weights[j] * from[x];
    }
  }
  std::vector<std::complex<float>> folded(sum.size());
  for (std::int64_t y = 0; y < along_.length(); ++y) {
    auto* to = folded.data() + y * across_.length();
    for (std::int64_t x = 0; x < across_.extended_length(); ++x) {
      const auto value = wide[static_cast<std::size_t>(y) * width + static_cast<std::size_t>(x)];
      for (int i = 0; i < 2; ++i) to[across_[x].pixels[i]] += across_[x].weights[i] * value;
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
    for_opposite_frequencies([&](const Frequency& k) {
      const std::complex<float> both(transfer(k, s),
                                     s + 1 < num_defoci_ ? transfer(k, s + 1) : 0.0f);
      pair[k.at] *= both;
      if (k.at != k.opposite) pair[k.opposite] *= both;
    });
    transform_.inverse(pair);
    add_folded_pair(pair, s, result);
  }
  return result;
}

}  // namespace tomofield::microscope
