#include "objective/axis_penalty.h"

#include <kiss_fft.h>
#include <kiss_fftnd.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <memory>
#include <numbers>

#include "base/check.h"

namespace tomofield::objective {
namespace {

using Plan = std::unique_ptr<void, decltype(&std::free)>;

// Returns the frequency of an index in cycles over the whole axis: 0, 1 … −1.
int signed_frequency(int index, int n) { return index <= n / 2 ? index : index - n; }

// Holds the ring of a frequency, and its radius in parts of the Nyquist frequency.
struct Radius {
  int ring;
  double nyquist_part;
  Radius(const SliceShape& s, int v, int u) {
    const double cycles_x = static_cast<double>(signed_frequency(u, s.nx)) / s.nx;
    const double cycles_y = static_cast<double>(signed_frequency(v, s.ny)) / s.ny;
    const double radius = std::hypot(cycles_x, cycles_y);
    ring = static_cast<int>(std::lround(radius * std::max(s.nx, s.ny)));
    nyquist_part = 2.0 * radius;
  }
};

int num_rings(const SliceShape& s) { return std::max(s.nx, s.ny) / 2 + 1; }

double amplitude(const SliceSpectra::Complex& c) {
  return std::hypot(static_cast<double>(c.re), static_cast<double>(c.im));
}

}  // namespace

std::vector<float> hann_window(int n) {
  std::vector<float> window;
  const double scale = std::sqrt(8.0 / 3.0);
  for (int i = 0; i < n; ++i) {
    const double s = std::sin(std::numbers::pi * (i + 0.5) / n);
    window.push_back(static_cast<float>(scale * s * s));
  }
  return window;
}

SliceSpectra::SliceSpectra(const SliceShape& shape, std::span<const float> samples)
    : shape_(shape), values_(shape.size()) {
  const int dims[] = {shape.ny, shape.nx};
  const Plan plan(kiss_fftnd_alloc(dims, 2, 0, nullptr, nullptr), &std::free);
  TOMOFIELD_CHECK(plan != nullptr && samples.size() == shape.size(), "plan of the transform");
  const auto window_x = hann_window(shape.nx), window_y = hann_window(shape.ny);
  const float unitary = static_cast<float>(1.0 / std::sqrt(static_cast<double>(shape.plane())));
  std::vector<kiss_fft_cpx> in(shape.plane()), out(shape.plane());
  for (int s = 0; s < shape.slices; ++s) {
    const std::size_t first = static_cast<std::size_t>(s) * shape.plane();
    for (std::size_t n = 0; n < shape.plane(); ++n) {
      const float w = window_y[n / static_cast<std::size_t>(shape.nx)] *
                      window_x[n % static_cast<std::size_t>(shape.nx)];
      in[n] = {unitary * w * samples[first + n], 0.0f};
    }
    kiss_fftnd(static_cast<kiss_fftnd_cfg>(plan.get()), in.data(), out.data());
    for (std::size_t n = 0; n < shape.plane(); ++n) values_[first + n] = {out[n].r, out[n].i};
  }
}

SliceSpectra::Complex SliceSpectra::at(int slice, int v, int u) const {
  return values_[static_cast<std::size_t>(slice) * shape_.plane() +
                 static_cast<std::size_t>(v) * shape_.nx + u];
}

std::vector<double> ring_references(const SliceSpectra& spectra, RingReference reference) {
  const SliceShape& s = spectra.shape();
  const auto rings = static_cast<std::size_t>(num_rings(s));
  std::vector<double> total(rings, 0.0), largest(rings);
  std::vector<int> count(rings, 0);
  for (int slice = 0; slice < s.slices; ++slice) {
    std::fill(largest.begin(), largest.end(), 0.0);
    for (int v = 0; v < s.ny; ++v) {
      for (int u = 0; u < s.nx; ++u) {
        if (std::abs(signed_frequency(u, s.nx)) < 2 || std::abs(signed_frequency(v, s.ny)) < 2)
          continue;
        const auto ring = static_cast<std::size_t>(Radius(s, v, u).ring);
        if (ring >= rings) continue;
        const double a = amplitude(spectra.at(slice, v, u));
        if (reference == RingReference::kMean) total[ring] += a;
        largest[ring] = std::max(largest[ring], a);
        ++count[ring];
      }
    }
    if (reference == RingReference::kMax)
      for (std::size_t r = 0; r < rings; ++r) total[r] += largest[r];
  }
  for (std::size_t r = 0; r < rings; ++r) {
    const int terms = reference == RingReference::kMean ? count[r] : s.slices;
    total[r] = count[r] > 0 ? total[r] / terms : -1.0;
  }
  return total;
}

namespace {

// Gives access to one of the two axes of a stack of spectra: F(0, k) or F(k, 0) for all k.
class AxisLine {
 public:
  AxisLine(const SliceSpectra& spectra, bool along_x)
      : spectra_(spectra),
        along_x_(along_x),
        n_(along_x ? spectra.shape().nx : spectra.shape().ny) {}

  int size() const { return n_; }
  Radius radius(int k) const {
    return Radius(spectra_.shape(), along_x_ ? 0 : k, along_x_ ? k : 0);
  }
  SliceSpectra::Complex at(int slice, int k) const {
    return spectra_.at(slice, along_x_ ? 0 : k, along_x_ ? k : 0);
  }

 private:
  const SliceSpectra& spectra_;
  bool along_x_;
  int n_;
};

// Returns Σ_k w max(0, A − R) on one axis. Stores its derivative by the axis in each slice.
double line_penalty(const AxisLine& line, int slices, const std::vector<double>& references,
                    const AxisPenaltyOptions& options, std::vector<kiss_fft_cpx>& gradient) {
  const int n = line.size();
  const double epsilon = options.epsilon;
  gradient.assign(static_cast<std::size_t>(slices) * n, {0.0f, 0.0f});
  double sum = 0.0;
  for (int k = 2; k <= n - 2; ++k) {  // 0 and ±1 hold the window's spectrum of the mean
    const Radius radius = line.radius(k);
    const double reference = references[static_cast<std::size_t>(radius.ring)];
    if (reference < 0) continue;
    const double weight =
        1.0 / (std::exp((options.cutoff - radius.nyquist_part) / options.width) + 1.0);
    const auto smooth_amplitude = [&](int slice) {
      const double a = amplitude(line.at(slice, k));
      return std::sqrt(a * a + epsilon * epsilon);
    };
    double mean = 0.0;
    for (int slice = 0; slice < slices; ++slice)
      mean += (smooth_amplitude(slice) - epsilon) / slices;
    if (mean <= reference) continue;
    sum += weight * (mean - reference);
    for (int slice = 0; slice < slices; ++slice) {
      const auto slope = static_cast<float>(weight / (slices * smooth_amplitude(slice)));
      const auto c = line.at(slice, k);
      gradient[static_cast<std::size_t>(slice * n + k)] = {slope * c.re, slope * c.im};
    }
  }
  return sum;
}

// Applies the adjoint of an axis line. F(0, v) is the transform of windowed sums over x, so apart
// from the window every sample of a row has the same derivative.
void spread_line(const SliceShape& s, bool along_x, const std::vector<kiss_fft_cpx>& line,
                 double weight, std::span<float> gradient) {
  const int n = along_x ? s.nx : s.ny;
  const Plan plan(kiss_fft_alloc(n, 1, nullptr, nullptr), &std::free);
  const auto window_x = hann_window(s.nx), window_y = hann_window(s.ny);
  const auto scale = static_cast<float>(weight / std::sqrt(static_cast<double>(s.plane())));
  std::vector<kiss_fft_cpx> out(static_cast<std::size_t>(n));
  float* to = gradient.data();
  for (int slice = 0; slice < s.slices; ++slice) {
    kiss_fft(static_cast<kiss_fft_cfg>(plan.get()), line.data() + slice * n, out.data());
    for (std::size_t y = 0; y < window_y.size(); ++y) {
      for (std::size_t x = 0; x < window_x.size(); ++x)
        *to++ += scale * window_y[y] * window_x[x] * out[along_x ? x : y].r;
    }
  }
}

}  // namespace

double axis_penalty(const SliceShape& shape, std::span<const float> samples,
                    const AxisPenaltyOptions& options, double weight, std::span<float> gradient) {
  const SliceSpectra spectra(shape, samples);
  const std::vector<double> references = ring_references(spectra, options.reference);
  const double share = weight / (shape.nx + shape.ny);
  std::vector<kiss_fft_cpx> line_gradient;
  double sum = 0.0;
  for (const bool along_x : {true, false}) {
    const AxisLine line(spectra, along_x);
    sum += line_penalty(line, shape.slices, references, options, line_gradient);
    spread_line(shape, along_x, line_gradient, share, gradient);
  }
  return share * sum;
}

}  // namespace tomofield::objective
