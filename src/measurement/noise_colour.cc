#include "measurement/noise_colour.h"

#include <algorithm>
#include <cmath>
#include <complex>

#include "base/check.h"
#include "fourier/image_transform.h"

namespace tomofield::measurement {
namespace {

// W is smooth, so it reaches no farther than this.
constexpr std::int64_t kMargin_px = 16;

constexpr int kSmoothings = 2;

// Returns the index of the shell in which a place lies.
std::size_t shell_at(float place) {
  return static_cast<std::size_t>(
      std::clamp<std::int64_t>(static_cast<std::int64_t>(place), 0, NoiseColour::kShells - 1));
}

// Returns a value of the shells, linear between their middles.
float interpolated(std::span<const float> shells, float place) {
  const float at = std::clamp(place - 0.5f, 0.0f, static_cast<float>(shells.size() - 1));
  const auto first = std::min(static_cast<std::size_t>(at), shells.size() - 2);
  const float part = at - static_cast<float>(first);
  return shells[first] + part * (shells[first + 1] - shells[first]);
}

// Averages the power of each shell with its neighbours', by how many frequencies they have.
std::vector<double> smoothed(const std::vector<double>& power, const std::vector<double>& counts) {
  std::vector<double> result(power.size());
  for (std::size_t s = 0; s < power.size(); ++s) {
    double sum = 0.0, weights = 0.0;
    for (std::size_t t = s > 0 ? s - 1 : s; t < std::min(s + 2, power.size()); ++t) {
      const double weight = counts[t] * (t == s ? 2.0 : 1.0);
      sum += weight * power[t];
      weights += weight;
    }
    result[s] = weights > 0.0 ? sum / weights : power[s];
  }
  return result;
}

}  // namespace

NoiseColour::NoiseColour(std::int64_t width, std::int64_t height)
    : width_(width),
      height_(height),
      transform_(fourier::fast_even_size(width + kMargin_px),
                 fourier::fast_even_size(height + kMargin_px)),
      counts_(kShells) {
  for (std::int64_t y = 0; y < transform_.height(); ++y)
    for (std::int64_t x = 0; x < transform_.half_width(); ++x) {
      const double k = std::hypot(fourier::cycles_per_pixel(x, transform_.width()),
                                  fourier::cycles_per_pixel(y, transform_.height()));
      places_.push_back(static_cast<float>(k * kShellsPerCycle));
      counts_[shell_at(places_.back())] += copies_of(places_.size() - 1);
    }
}

// Returns how many frequencies of the whole spectrum a column of its half stands for.
double NoiseColour::copies_of(std::size_t i) const {
  const std::int64_t x = static_cast<std::int64_t>(i) % transform_.half_width();
  return x == 0 || 2 * x == transform_.width() ? 1.0 : 2.0;
}

// Returns W of each shell, but for a factor.
std::vector<double> NoiseColour::weights_of(
    const fourier::RealTransform::Spectrum& spectrum) const {
  std::vector<double> power(kShells);
  for (std::size_t i = 0; i < spectrum.size(); ++i)
    power[shell_at(places_[i])] += copies_of(i) * static_cast<double>(std::norm(spectrum[i]));
  double mean = 0.0;
  for (std::size_t s = 0; s < power.size(); ++s) {
    mean += power[s] / static_cast<double>(transform_.image_size());
    if (counts_[s] > 0.0) power[s] /= counts_[s];
  }
  if (!(mean > 0.0)) return std::vector<double>(kShells, 1.0);
  for (int i = 0; i < kSmoothings; ++i) power = smoothed(power, counts_);
  std::vector<double> weights;
  for (const double of_shell : power)
    weights.push_back(of_shell > 0.0 ? std::clamp(mean / of_shell, kLeast, kMost) : kMost);
  return weights;
}

std::vector<double> NoiseColour::weigh(std::span<float> residual) const {
  TOMOFIELD_CHECK(std::ssize(residual) == width_ * height_, "size of the residual");
  fourier::RealTransform::Image image(transform_.image_size());
  fourier::RealTransform::Spectrum spectrum(transform_.spectrum_size());
  for (std::int64_t y = 0; y < height_; ++y)
    std::copy_n(residual.begin() + y * width_, width_, image.begin() + y * transform_.width());
  transform_.forward(image, spectrum);
  std::vector<double> weights = weights_of(spectrum);
  const std::vector<float> of_shells(weights.begin(), weights.end());
  double squares = 0.0, weighted = 0.0;
  for (std::size_t i = 0; i < spectrum.size(); ++i) {
    const float weight = interpolated(of_shells, places_[i]);
    const double square = copies_of(i) * static_cast<double>(std::norm(spectrum[i]));
    squares += square;
    weighted += square * static_cast<double>(weight);
    spectrum[i] *= weight;
  }
  const double keeping_squares = weighted > 0.0 ? squares / weighted : 1.0;
  for (double& weight : weights) weight *= keeping_squares;
  transform_.inverse(spectrum, image);
  const auto factor =
      static_cast<float>(keeping_squares / static_cast<double>(transform_.image_size()));
  for (std::int64_t y = 0; y < height_; ++y)
    for (std::int64_t x = 0; x < width_; ++x)
      residual[static_cast<std::size_t>(y * width_ + x)] =
          factor * image[static_cast<std::size_t>(y * transform_.width() + x)];
  return weights;
}

}  // namespace tomofield::measurement
