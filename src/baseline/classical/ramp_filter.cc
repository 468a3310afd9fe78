#include "baseline/classical/ramp_filter.h"

#include <kiss_fft.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdlib>
#include <numbers>

#include "base/check.h"
#include "kernels/lanes.h"

namespace tomofield::baseline {
namespace {

using kernels::kLanes;

constexpr double kPi = std::numbers::pi;

void free_plan(kiss_fft_state* plan) { std::free(plan); }

// Returns the samples of the ramp's kernel: index i holds the sample i, and the i-th index from the
// end the sample −i.
std::vector<kiss_fft_cpx> ramp_kernel(int length) {
  std::vector<kiss_fft_cpx> kernel(static_cast<std::size_t>(length), {0.0f, 0.0f});
  kernel[0].r = 0.25f;
  for (int i = 1; i <= length / 2; i += 2) {
    const float value = static_cast<float>(-1.0 / (kPi * kPi * i * i));
    kernel[static_cast<std::size_t>(i)].r = value;
    kernel[static_cast<std::size_t>(length - i)].r = value;
  }
  return kernel;
}

double roll_off(const RampFilterOptions& options, double f) {
  const double cosine = std::cos(kPi * f);
  const double window = options.window == RampWindow::kHann     ? cosine * cosine
                        : options.window == RampWindow::kCosine ? cosine
                                                                : 1.0;
  if (f <= options.cutoff) return window;
  const double beyond = (f - options.cutoff) / options.falloff;
  return window * options.cutoff / f * std::exp(-0.5 * beyond * beyond);
}

}  // namespace

// Pads rows to twice their length, so that the convolution does not wrap around.
RampFilter::RampFilter(const RampFilterOptions& options, std::int64_t width)
    : width_(width),
      length_(2 * kiss_fft_next_fast_size(static_cast<int>(width))),
      forward_(kiss_fft_alloc(length_, 0, nullptr, nullptr), &free_plan),
      inverse_(kiss_fft_alloc(length_, 1, nullptr, nullptr), &free_plan) {
  TOMOFIELD_CHECK(forward_ && inverse_, "plan of the transform");
  const std::vector<kiss_fft_cpx> kernel = ramp_kernel(length_);
  std::vector<kiss_fft_cpx> spectrum(kernel.size());
  kiss_fft(forward_.get(), kernel.data(), spectrum.data());
  for (int i = 0; i < length_; ++i) {
    const double f = static_cast<double>(std::min(i, length_ - i)) / length_;
    const float ramp = spectrum[static_cast<std::size_t>(i)].r;
    response_.push_back(ramp * static_cast<float>(roll_off(options, f)));
  }
}

// Filters two rows at once, as real and imaginary parts. The response is real and even, so they
// stay apart.
void RampFilter::apply(float* rays) const {
  const std::size_t length = static_cast<std::size_t>(length_);
  const std::size_t width = static_cast<std::size_t>(width_);
  std::vector<kiss_fft_cpx> rows(length), spectrum(length);
  for (std::size_t lane = 0; lane < kLanes; lane += 2) {
    std::fill(rows.begin(), rows.end(), kiss_fft_cpx{0.0f, 0.0f});
    for (std::size_t x = 0; x < width; ++x)
      rows[x] = {rays[x * kLanes + lane], rays[x * kLanes + lane + 1]};
    kiss_fft(forward_.get(), rows.data(), spectrum.data());
    for (std::size_t i = 0; i < length; ++i) {
      const float factor = response_[i] / static_cast<float>(length);
      spectrum[i] = {factor * spectrum[i].r, factor * spectrum[i].i};
    }
    kiss_fft(inverse_.get(), spectrum.data(), rows.data());
    for (std::size_t x = 0; x < width; ++x) {
      rays[x * kLanes + lane] = rows[x].r;
      rays[x * kLanes + lane + 1] = rows[x].i;
    }
  }
}

}  // namespace tomofield::baseline
