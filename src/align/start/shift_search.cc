#include "align/start/shift_search.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "base/check.h"

namespace tomofield::alignment {
namespace {

using Image = ImageTransform::Image;

constexpr double kLeastOverlap = 0.3;  // of the reference's weight

// Returns Σ_q a(q) b(q + u) for all u, which overwrites b. Both are transforms.
void correlate(const ImageTransform& transform, const Image& a, Image& b) {
  for (std::size_t i = 0; i < b.size(); ++i) b[i] *= std::conj(a[i]);
  transform.inverse(b);
}

Image transformed(const ImageTransform& transform, Image image) {
  transform.forward(image);
  return image;
}

// Returns where a parabola through three values has its highest point: −½ to ½.
double parabola_peak(double left, double middle, double right) {
  const double bend = left - 2.0 * middle + right;
  return bend < 0.0 ? std::clamp(0.5 * (left - right) / bend, -0.5, 0.5) : 0.0;
}

}  // namespace

ShiftPeak find_shift(const ImageTransform& transform, const Reference& reference,
                     const tilt_series::MaskedImage& image, const std::array<double, 2>& range_px) {
  const std::size_t size = image.values.size();
  const std::int64_t width = image.width, height = image.height;
  TOMOFIELD_CHECK(width == transform.width() && height == transform.height(), "size of the image");
  Image product(size), squares(size), counts(size), reference_squares(size);
  for (std::size_t i = 0; i < size; ++i) {
    product[i] = image.values[i];
    squares[i] = image.values[i] * image.values[i];
    counts[i] = image.valid[i] ? 1.0f : 0.0f;
    reference_squares[i] = std::norm(reference.values[i]);
  }
  for (Image* part : {&product, &squares, &counts}) transform.forward(*part);
  const Image weights = transformed(transform, reference.weights);
  Image overlap = counts;
  correlate(transform, transformed(transform, reference.values), product);
  correlate(transform, weights, squares);
  correlate(transform, weights, overlap);
  correlate(transform, transformed(transform, reference_squares), counts);

  double all_weight = 0.0, all_squares = 0.0;
  for (std::size_t i = 0; i < size; ++i) {
    all_weight += reference.weights[i].real();
    all_squares += reference_squares[i].real();
  }
  const auto at = [&](std::int64_t x, std::int64_t y) {
    return static_cast<std::size_t>(((y + height) % height) * width + (x + width) % width);
  };
  const auto coefficient = [&](std::int64_t x, std::int64_t y) {
    const std::size_t i = at(x, y);
    if (!(overlap[i].real() > kLeastOverlap * all_weight)) return 0.0;
    if (!(counts[i].real() > 0.1 * kLeastOverlap * all_squares)) return 0.0;
    const double energy = static_cast<double>(counts[i].real()) *
                          std::max(0.0, static_cast<double>(squares[i].real()));
    return energy > 0.0 ? product[i].real() / std::sqrt(energy) : 0.0;
  };

  const auto range_x = std::min(static_cast<std::int64_t>(range_px[0]), width / 2 - 1);
  const auto range_y = std::min(static_cast<std::int64_t>(range_px[1]), height / 2 - 1);
  ShiftPeak peak{.correlation = -std::numeric_limits<double>::infinity()};
  std::int64_t peak_x = 0, peak_y = 0;
  double sum = 0.0, sum_squares = 0.0;
  for (std::int64_t y = -range_y; y <= range_y; ++y)
    for (std::int64_t x = -range_x; x <= range_x; ++x) {
      const double value = coefficient(x, y);
      sum += value;
      sum_squares += value * value;
      if (value <= peak.correlation) continue;
      peak.correlation = value;
      peak_x = x;
      peak_y = y;
    }
  const auto places = static_cast<double>((2 * range_x + 1) * (2 * range_y + 1));
  const double mean = sum / places;
  const double spread = std::sqrt(std::max(0.0, sum_squares / places - mean * mean));
  peak.prominence = spread > 0.0 ? (peak.correlation - mean) / spread : 0.0;
  peak.moved_px = {
      static_cast<double>(peak_x) + parabola_peak(coefficient(peak_x - 1, peak_y), peak.correlation,
                                                  coefficient(peak_x + 1, peak_y)),
      static_cast<double>(peak_y) + parabola_peak(coefficient(peak_x, peak_y - 1), peak.correlation,
                                                  coefficient(peak_x, peak_y + 1))};
  return peak;
}

}  // namespace tomofield::alignment
