#include "microscope/view_filter.h"

#include <algorithm>
#include <cmath>
#include <complex>
#include <numbers>
#include <utility>

#include "base/check.h"
#include "fourier/image_transform.h"
#include "microscope/exposure.h"

namespace tomofield::microscope {
namespace {

constexpr std::int64_t kSmallestMargin_px = 8;

// Over a range of defocus of this part of a step, one defocus errs no more than the interpolation.
constexpr double kNoStep = 0.2;

// Returns the smallest and the largest defocus that a slope adds within an image.
std::pair<double, double> range_of(const DefocusSlope& slope, std::int64_t width,
                                   std::int64_t height) {
  const double half_A = std::abs(slope.x_A) * static_cast<double>(width - 1) / 2 +
                        std::abs(slope.y_A) * static_cast<double>(height - 1) / 2;
  return {slope.at_centre_A - half_A, slope.at_centre_A + half_A};
}

// Step of the search for the largest transfer, in cycles a pixel.
constexpr double kStepOfBound = 1.0 / 512;

constexpr float kWienerConstant = 0.1f;

// The sine is interpolated to 3·10⁻⁷.
constexpr std::size_t kStepsOfTables = 4096;

// Returns the sine of an angle in turns, from 0 to 1.
float sine_of_turns(double turns) {
  static const InterpolatedTable table(1.0, kStepsOfTables,
                                       [](double t) { return std::sin(2 * std::numbers::pi * t); });
  return table(turns);
}

// Returns the frequencies of a transform, of which `count` are kept, in cycles per Å.
std::vector<double> frequencies(std::int64_t size, std::int64_t count, double pixel_size_A) {
  std::vector<double> k;
  for (std::int64_t i = 0; i < count; ++i)
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
      kx_(frequencies(transform_.width(), transform_.half_width(), transfer.pixel_size_A)),
      ky_(frequencies(transform_.height(), transform_.height(), transfer.pixel_size_A)),
      signal_(
          0.5 / (transfer.pixel_size_A * transfer.pixel_size_A), kStepsOfTables, [&](double k2) {
            const double k = std::sqrt(k2);
            return ctf_.envelope(k2) * (transfer.detector ? transfer.detector->transfer(k) : 1.0) *
                   signal_after(transfer.exposure, k, transfer.optics.voltage_kV);
          }) {
  const double nyquist = 0.5 / view_.pixel_size_A;
  const auto [low_A, high_A] = range_of(view_.slope, width, height);
  const double largest_step_A = 1.0 / (4.0 * ctf_.wavelength_A() * nyquist * nyquist);
  const bool is_even = high_A - low_A <= kNoStep * largest_step_A;
  const std::int64_t num_steps =
      is_even ? 0 : std::llround(std::ceil((high_A - low_A) / largest_step_A));
  first_defocus_A_ = is_even ? (low_A + high_A) / 2 : low_A;
  num_defoci_ = num_steps + 1;
  if (num_steps > 0) defocus_step_A_ = (high_A - low_A) / static_cast<double>(num_steps);
  keep_transfers();
}

// Returns H_s at a frequency of the padded grid, over the number of its values, which an inverse
// transform leaves out. Frequency ½ stands for −½ too, where astigmatism may give another value:
// their mean is the same at k and −k, so that real images stay real.
float ViewFilter::computed_transfer(std::int64_t x, std::int64_t y, std::int64_t s) const {
  const double kx = kx_[static_cast<std::size_t>(x)], ky = ky_[static_cast<std::size_t>(y)];
  const auto sine = [&](double of_ky) {
    // An angle is that many turns, of which a whole number makes no difference.
    constexpr double kWholeTurns = 1 << 20;
    const double turns = ctf_.turns(kx, of_ky, defocus_of(s)) + kWholeTurns;
    return sine_of_turns(turns - static_cast<double>(static_cast<std::int64_t>(turns)));
  };
  float ctf = sine(ky);  // −CTF
  if (2 * x == transform_.width() || 2 * y == transform_.height()) ctf = (ctf + sine(-ky)) / 2;
  const float values = static_cast<float>(transform_.image_size());
  return signal_(kx * kx + ky * ky) * (view_.is_flipped ? std::abs(ctf) : ctf) / values;
}

void ViewFilter::compute_row(std::int64_t ky, std::int64_t s, std::span<float> row) const {
  for (std::size_t x = 0; x < row.size(); ++x)
    row[x] = computed_transfer(static_cast<std::int64_t>(x), ky, s);
}

// Computes the transfers once, if they do not take much memory.
void ViewFilter::keep_transfers() {
  const auto width = static_cast<std::size_t>(transform_.half_width());
  const std::size_t of_a_defocus = transform_.spectrum_size();
  if (of_a_defocus * static_cast<std::size_t>(num_defoci_) > kMostKept / sizeof(float)) return;
  std::vector<float> transfers(of_a_defocus * static_cast<std::size_t>(num_defoci_));
  for (std::int64_t s = 0; s < num_defoci_; ++s)
    for (std::int64_t ky = 0; ky < transform_.height(); ++ky)
      compute_row(ky, s,
                  std::span(transfers).subspan(static_cast<std::size_t>(s) * of_a_defocus +
                                                   static_cast<std::size_t>(ky) * width,
                                               width));
  transfers_ = std::move(transfers);
}

// Calls a function with the place of each row of a spectrum and with H_s on it.
template <typename Visit>
void ViewFilter::for_transfers(std::int64_t s, const Visit& visit) const {
  const auto width = static_cast<std::size_t>(transform_.half_width());
  std::vector<float> computed(transfers_.empty() ? width : 0);
  for (std::int64_t ky = 0; ky < transform_.height(); ++ky) {
    const std::size_t at = static_cast<std::size_t>(ky) * width;
    if (transfers_.empty()) {
      compute_row(ky, s, computed);
      visit(at, std::span<const float>(computed));
    } else {
      const std::size_t first = static_cast<std::size_t>(s) * transform_.spectrum_size();
      visit(at, std::span(transfers_).subspan(first + at, width));
    }
  }
}

bool ViewFilter::passes_mean() const {
  const auto values = static_cast<float>(transform_.image_size());
  return 2.0f * std::abs(values * computed_transfer(0, 0, 0)) >= 1.0f;
}

double ViewFilter::largest_transfer(double from, double to) const {
  const double count = std::ceil((to - from) / kStepOfBound);
  const double first = from / view_.pixel_size_A, step = (to - from) / count / view_.pixel_size_A;
  double largest = 0.0;
  for (double i = 0; i < count; ++i) {
    const double k = first + i * step;
    const double signal = static_cast<double>(signal_(k * k));  // falls with the frequency
    largest = std::max(
        largest, signal * ctf_.largest(k, k + step, defocus_of(0), defocus_of(num_defoci_ - 1)));
  }
  return largest;
}

// Computes w_s on a row of the image.
void ViewFilter::weigh_row(std::int64_t y, std::int64_t s, std::span<float> weights) const {
  if (num_defoci_ == 1 || s == kEverywhere) {
    std::ranges::fill(weights, 1.0f);
    return;
  }
  const double first_A =
      view_.slope.at(0.5 - static_cast<double>(across_.length()) / 2,
                     static_cast<double>(y) + 0.5 - static_cast<double>(along_.length()) / 2);
  const auto first = static_cast<float>((first_A - defocus_of(s)) / defocus_step_A_);
  const auto step = static_cast<float>(view_.slope.x_A / defocus_step_A_);
  for (std::size_t x = 0; x < weights.size(); ++x)
    weights[x] = std::max(0.0f, 1.0f - std::abs(first + step * static_cast<float>(x)));
}

// Computes the extension of w_s image.
void ViewFilter::extend(std::span<const float> image, std::int64_t s, Image& extended) const {
  const auto width = static_cast<std::size_t>(transform_.width());
  const auto length = static_cast<std::size_t>(across_.length());
  std::vector<float> weights(length);
  for (std::int64_t y = 0; y < along_.length(); ++y) {
    const float* from = image.data() + static_cast<std::size_t>(y) * length;
    float* row = extended.data() + static_cast<std::size_t>(y) * width;
    weigh_row(y, s, weights);
    for (std::size_t x = 0; x < length; ++x) row[x] = weights[x] * from[x];
    for (std::size_t x = length; x < width; ++x) {
      const auto& [pixels, shares] = across_[static_cast<std::int64_t>(x)];
      row[x] = shares[0] * row[pixels[0]] + shares[1] * row[pixels[1]];
    }
  }
  for (std::int64_t y = along_.length(); y < along_.extended_length(); ++y) {
    const auto& [rows, shares] = along_[y];
    const float* first = extended.data() + static_cast<std::size_t>(rows[0]) * width;
    const float* second = extended.data() + static_cast<std::size_t>(rows[1]) * width;
    float* row = extended.data() + static_cast<std::size_t>(y) * width;
    for (std::size_t x = 0; x < width; ++x) row[x] = shares[0] * first[x] + shares[1] * second[x];
  }
}

// Adds the transpose of extend() to `sum`. The contents of `extended` are unspecified afterwards.
void ViewFilter::add_folded(Image& extended, std::int64_t s, std::span<float> sum) const {
  const auto width = static_cast<std::size_t>(transform_.width());
  const auto length = static_cast<std::size_t>(across_.length());
  for (std::int64_t y = along_.length(); y < along_.extended_length(); ++y) {
    const float* row = extended.data() + static_cast<std::size_t>(y) * width;
    for (int j = 0; j < 2; ++j) {
      float* to = extended.data() + static_cast<std::size_t>(along_[y].pixels[j]) * width;
      for (std::size_t x = 0; x < width; ++x) to[x] += along_[y].weights[j] * row[x];
    }
  }
  std::vector<float> weights(length);
  for (std::int64_t y = 0; y < along_.length(); ++y) {
    float* row = extended.data() + static_cast<std::size_t>(y) * width;
    for (std::size_t x = length; x < width; ++x) {
      const auto& [pixels, shares] = across_[static_cast<std::int64_t>(x)];
      for (int i = 0; i < 2; ++i) row[pixels[i]] += shares[i] * row[x];
    }
    weigh_row(y, s, weights);
    float* to = sum.data() + static_cast<std::size_t>(y) * length;
    for (std::size_t x = 0; x < length; ++x) to[x] += weights[x] * row[x];
  }
}

std::vector<float> ViewFilter::apply(std::span<const float> image) const {
  TOMOFIELD_CHECK(std::ssize(image) == across_.length() * along_.length(), "size of the image");
  Image extended(transform_.image_size());
  Spectrum spectrum(transform_.spectrum_size()), sum(num_defoci_ > 1 ? spectrum.size() : 0);
  for (std::int64_t s = 0; s < num_defoci_; ++s) {
    extend(image, s, extended);
    transform_.forward(extended, spectrum);
    for_transfers(s, [&](std::size_t at, std::span<const float> transfers) {
      std::complex<float>* values = spectrum.data() + at;
      if (s == 0) {
        for (std::size_t x = 0; x < transfers.size(); ++x) values[x] *= transfers[x];
      } else {
        for (std::size_t x = 0; x < transfers.size(); ++x) sum[at + x] += values[x] * transfers[x];
      }
    });
    if (s == 0 && num_defoci_ > 1) std::swap(spectrum, sum);
  }
  transform_.inverse(num_defoci_ > 1 ? sum : spectrum, extended);
  std::vector<float> filtered;
  filtered.reserve(image.size());
  for (std::int64_t y = 0; y < along_.length(); ++y)
    filtered.insert(filtered.end(), extended.begin() + y * transform_.width(),
                    extended.begin() + y * transform_.width() + across_.length());
  return filtered;
}

// Returns the transform of an image with zeros around it.
ViewFilter::Spectrum ViewFilter::spectrum_of(std::span<const float> image) const {
  TOMOFIELD_CHECK(std::ssize(image) == across_.length() * along_.length(), "size of the image");
  Image extended(transform_.image_size());
  for (std::int64_t y = 0; y < along_.length(); ++y)
    std::copy_n(image.begin() + y * across_.length(), across_.length(),
                extended.begin() + y * transform_.width());
  Spectrum spectrum(transform_.spectrum_size());
  transform_.forward(extended, spectrum);
  return spectrum;
}

template <typename Factor, typename Add>
void ViewFilter::spread(const Spectrum& spectrum, const Factor& factor, const Add& add) const {
  Spectrum filtered(transform_.spectrum_size());
  Image image(transform_.image_size());
  for (std::int64_t s = 0; s < num_defoci_; ++s) {
    for_transfers(s, [&](std::size_t at, std::span<const float> transfers) {
      for (std::size_t x = 0; x < transfers.size(); ++x)
        filtered[at + x] = spectrum[at + x] * factor(transfers[x]);
    });
    transform_.inverse(filtered, image);
    add(image, s);
  }
}

std::vector<float> ViewFilter::apply_transpose(std::span<const float> image) const {
  std::vector<float> result(image.size());
  spread(
      spectrum_of(image), [](float transfer) { return transfer; },
      [&](Image& filtered, std::int64_t s) { add_folded(filtered, s, result); });
  return result;
}

std::vector<float> ViewFilter::corrected(std::span<const float> view,
                                         CtfCorrection correction) const {
  TOMOFIELD_CHECK(std::ssize(view) == across_.length() * along_.length(), "size of the view");
  Image extended(transform_.image_size());
  Spectrum spectrum(transform_.spectrum_size());
  extend(view, kEverywhere, extended);
  transform_.forward(extended, spectrum);
  const float values = static_cast<float>(transform_.image_size());
  const auto factor = [&](float transfer) {
    const float h = values * transfer;
    switch (correction) {
      case CtfCorrection::kFlip:
        return (h < 0.0f ? -1.0f : 1.0f) / values;
      case CtfCorrection::kMultiply:
        return transfer;
      case CtfCorrection::kWiener:
        return transfer / (h * h + kWienerConstant);
    }
    return transfer;
  };
  const auto length = static_cast<std::size_t>(across_.length());
  std::vector<float> result(view.size()), weights(length);
  spread(spectrum, factor, [&](const Image& image, std::int64_t s) {
    for (std::int64_t y = 0; y < along_.length(); ++y) {
      weigh_row(y, s, weights);
      const float* from = image.data() + y * transform_.width();
      float* to = result.data() + static_cast<std::size_t>(y) * length;
      for (std::size_t x = 0; x < length; ++x) to[x] += weights[x] * from[x];
    }
  });
  return result;
}

}  // namespace tomofield::microscope
