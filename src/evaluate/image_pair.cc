#include "evaluate/image_pair.h"

#include <algorithm>
#include <cmath>
#include <complex>
#include <cstddef>
#include <limits>

#include "base/check.h"
#include "evaluate/resolution/fsc.h"

namespace tomofield::evaluate {
namespace {

using Spectrum = std::vector<std::complex<float>>;

// Returns an image without its mean, under the window that fades at the edges. Pixels that one of
// the images lacks are 0.
std::vector<float> windowed(const Image& image, const Image& other, const base::Volume& window) {
  double sum = 0, weight = 0;
  const auto is_there = [&](std::size_t i) {
    return std::isfinite(image.values[i]) && std::isfinite(other.values[i]);
  };
  for (std::size_t i = 0; i < image.values.size(); ++i) {
    if (!is_there(i)) continue;
    sum += static_cast<double>(window.data[i] * image.values[i]);
    weight += static_cast<double>(window.data[i]);
  }
  const auto mean = static_cast<float>(weight > 0 ? sum / weight : 0.0);
  std::vector<float> values(image.values.size());
  for (std::size_t i = 0; i < values.size(); ++i)
    if (is_there(i)) values[i] = window.data[i] * (image.values[i] - mean);
  return values;
}

// Returns the part of a frequency, in cycles over the image, that counts.
double high_pass(double cycles) {
  constexpr double kFirstCycles = 4.0;  // half a wave is an eighth of the image
  return 1.0 - std::exp(-0.5 * cycles * cycles / (kFirstCycles * kFirstCycles));
}

// Returns the cross-correlation at every displacement; negative ones are at the end of an axis.
// Both images are transformed together as R + iM: they are real, so their own transforms are R(k) =
// (F(k) + conj F(−k)) / 2 and M(k) = (F(k) − conj F(−k)) / 2i.
Spectrum cross_correlation(const Image& reference, const Image& moved) {
  const base::Shape3 shape{moved.width, moved.height, 1};
  const base::Volume window = edge_window(shape);
  const std::vector<float> real = windowed(reference, moved, window),
                           imaginary = windowed(moved, reference, window);
  Spectrum joint, product(real.size());
  for (std::size_t i = 0; i < real.size(); ++i) joint.emplace_back(real[i], imaginary[i]);
  transform_volume(shape, joint);
  for (std::int64_t y = 0; y < shape.ny; ++y) {
    for (std::int64_t x = 0; x < shape.nx; ++x) {
      const auto i = static_cast<std::size_t>(y * shape.nx + x);
      const auto mirrored = static_cast<std::size_t>((shape.ny - y) % shape.ny * shape.nx +
                                                     (shape.nx - x) % shape.nx);
      const std::complex<float> f = joint[i], g = std::conj(joint[mirrored]);
      const std::complex<float> r = 0.5f * (f + g), m = std::complex(0.0f, -0.5f) * (f - g);
      const auto kx = static_cast<double>(signed_frequency(x, shape.nx));
      const auto ky = static_cast<double>(signed_frequency(y, shape.ny));
      // Conjugated, because the transform back is that of the conjugate.
      product[i] = std::conj(m) * r * static_cast<float>(high_pass(std::hypot(kx, ky)));
    }
  }
  transform_volume(shape, product);
  return product;
}

// Returns an image whose content lies dx and dy pixels farther; NaN where it had none.
Image shifted(const Image& image, std::int64_t dx, std::int64_t dy) {
  Image result{image.width, image.height,
               std::vector<float>(image.values.size(), std::numeric_limits<float>::quiet_NaN())};
  const std::int64_t first_x = std::max<std::int64_t>(dx, 0);
  const std::int64_t count = image.width - std::abs(dx);
  if (count <= 0) return result;
  for (std::int64_t y = std::max<std::int64_t>(dy, 0);
       y < image.height + std::min<std::int64_t>(dy, 0); ++y)
    std::copy_n(image.values.begin() + (y - dy) * image.width + first_x - dx, count,
                result.values.begin() + y * image.width + first_x);
  return result;
}

// Returns the place of the maximum of a parabola through three neighbours, from −½ to ½.
double vertex(double before, double here, double after) {
  const double curvature = before - 2 * here + after;
  return curvature < 0 ? std::clamp(0.5 * (before - after) / curvature, -0.5, 0.5) : 0.0;
}

}  // namespace

Image reduced(const Image& image, std::int64_t factor) {
  Image small{(image.width + factor - 1) / factor, (image.height + factor - 1) / factor, {}};
  for (std::int64_t y = 0; y < image.height; y += factor) {
    for (std::int64_t x = 0; x < image.width; x += factor) {
      const std::int64_t end_y = std::min(y + factor, image.height);
      const std::int64_t end_x = std::min(x + factor, image.width);
      double sum = 0, count = 0;
      for (std::int64_t j = y; j < end_y; ++j) {
        for (std::int64_t i = x; i < end_x; ++i) {
          const float value = image.values[static_cast<std::size_t>(j * image.width + i)];
          if (!std::isfinite(value)) continue;
          sum += static_cast<double>(value);
          count += 1;
        }
      }
      const bool counts = 2 * count >= static_cast<double>((end_x - x) * (end_y - y));
      small.values.push_back(counts ? static_cast<float>(sum / count)
                                    : std::numeric_limits<float>::quiet_NaN());
    }
  }
  return small;
}

std::vector<double> column_means(const Image& image) {
  std::vector<double> sums(static_cast<std::size_t>(image.width)), counts(sums);
  for (std::size_t i = 0; i < image.values.size(); ++i) {
    if (!std::isfinite(image.values[i])) continue;
    sums[i % sums.size()] += static_cast<double>(image.values[i]);
    counts[i % sums.size()] += 1;
  }
  for (std::size_t x = 0; x < sums.size(); ++x) sums[x] /= counts[x];  // 0 / 0 is NaN
  return sums;
}

Image without_column_means(const Image& image) {
  const std::vector<double> means = column_means(image);
  Image rest = image;
  for (std::size_t i = 0; i < rest.values.size(); ++i)
    rest.values[i] -= static_cast<float>(means[i % means.size()]);
  return rest;
}

double correlation(const Image& one, const Image& other) {
  TOMOFIELD_CHECK(one.width == other.width && one.height == other.height, "images of one size");
  double n = 0, x = 0, y = 0, xx = 0, xy = 0, yy = 0;
  for (std::size_t i = 0; i < one.values.size(); ++i) {
    const auto a = static_cast<double>(one.values[i]), b = static_cast<double>(other.values[i]);
    if (!std::isfinite(a) || !std::isfinite(b)) continue;
    n += 1;
    x += a;
    y += b;
    xx += a * a;
    xy += a * b;
    yy += b * b;
  }
  const double vx = n * xx - x * x, vy = n * yy - y * y;
  return vx > 0 && vy > 0 ? (n * xy - x * y) / std::sqrt(vx * vy) : 0.0;
}

double shifted_correlation(const Image& one, const Image& other, std::int64_t reach) {
  double best = -1.0;
  for (std::int64_t dy = -reach; dy <= reach; ++dy)
    for (std::int64_t dx = -reach; dx <= reach; ++dx)
      best = std::max(best, correlation(one, shifted(other, dx, dy)));
  return best;
}

std::array<double, 2> difference_correlation(const Image& one, const Image& other,
                                             std::int64_t distance) {
  Image difference{one.width, one.height, {}};
  for (std::size_t i = 0; i < one.values.size(); ++i)
    difference.values.push_back(one.values[i] - other.values[i]);
  return {correlation(difference, shifted(difference, distance, 0)),
          correlation(difference, shifted(difference, 0, distance))};
}

std::array<double, 2> displacement(const Image& reference, const Image& moved) {
  TOMOFIELD_CHECK(reference.width == moved.width && reference.height == moved.height,
                  "images of one size");
  const std::int64_t nx = moved.width, ny = moved.height;
  const Spectrum correlations = cross_correlation(reference, moved);
  const auto at = [&](std::int64_t dx, std::int64_t dy) {
    return static_cast<double>(
        correlations[static_cast<std::size_t>((dy + ny) % ny * nx + (dx + nx) % nx)].real());
  };
  std::int64_t best_x = 0, best_y = 0;
  for (std::int64_t dy = -ny / 4; dy <= ny / 4; ++dy) {
    for (std::int64_t dx = -nx / 4; dx <= nx / 4; ++dx) {
      if (at(dx, dy) <= at(best_x, best_y)) continue;
      best_x = dx;
      best_y = dy;
    }
  }
  const double here = at(best_x, best_y);
  return {
      static_cast<double>(best_x) + vertex(at(best_x - 1, best_y), here, at(best_x + 1, best_y)),
      static_cast<double>(best_y) + vertex(at(best_x, best_y - 1), here, at(best_x, best_y + 1))};
}

}  // namespace tomofield::evaluate
