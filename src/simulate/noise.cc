#include "simulate/noise.h"

#include <cmath>
#include <numbers>

#include "base/progress.h"
#include "base/threads/parallel.h"
#include "fourier/image_transform.h"

namespace tomofield::simulate {
namespace {

// Returns ln k!, for large k by three terms of Stirling's series, which are exact to rounding.
double log_factorial(double k) {
  if (k < 16.0) {
    double product = 1.0;
    for (double i = 2.0; i <= k; i += 1.0) product *= i;
    return std::log(product);
  }
  const double r = 1.0 / (k * k);
  const double series = (1.0 / 12.0 - r * (1.0 / 360.0 - r / 1260.0)) / k;
  return (k + 0.5) * std::log(k) - k + 0.5 * std::log(2.0 * std::numbers::pi) + series;
}

std::int64_t poisson_by_products(double mean, base::Random& random) {
  const double limit = std::exp(-mean);
  std::int64_t count = 0;
  for (double product = random.uniform(); product > limit; product *= random.uniform()) ++count;
  return count;
}

std::int64_t poisson_by_rejection(double mean, base::Random& random) {
  // The constants are the paper's fit of the hat function to all means above 10.
  const double b = 0.931 + 2.53 * std::sqrt(mean);
  const double a = -0.059 + 0.02483 * b;
  const double log_inverse_alpha = std::log(1.1239 + 1.1328 / (b - 3.4));
  const double quick_accept = 0.9277 - 3.6224 / (b - 2.0);
  const double log_mean = std::log(mean);
  while (true) {
    const double u = random.uniform() - 0.5;
    const double v = 1.0 - random.uniform();  // never 0, for the logarithm
    const double from_edge = 0.5 - std::abs(u);
    if (from_edge <= 0.0) continue;
    const double k = std::floor((2.0 * a / from_edge + b) * u + mean + 0.43);
    if (from_edge >= 0.07 && v <= quick_accept) return static_cast<std::int64_t>(k);
    if (k < 0.0 || (from_edge < 0.013 && v > from_edge)) continue;
    const double log_hat =
        std::log(v) + log_inverse_alpha - std::log(a / (from_edge * from_edge) + b);
    if (log_hat <= k * log_mean - mean - log_factorial(k)) return static_cast<std::int64_t>(k);
  }
}

template <typename Pixel>
void for_each_pixel(std::span<float> image, std::int64_t width, std::uint64_t seed,
                    std::uint64_t first_stream, const Pixel& pixel) {
  const auto num_rows = static_cast<std::int64_t>(image.size()) / width;
  base::parallel_for("add noise", num_rows, [&](std::int64_t row) {
    base::allow_interruption();
    base::Random random(seed, first_stream + static_cast<std::uint64_t>(row));
    for (float& value :
         image.subspan(static_cast<std::size_t>(row * width), static_cast<std::size_t>(width)))
      value = static_cast<float>(pixel(static_cast<double>(value), random));
  });
}

}  // namespace

std::int64_t poisson(double mean, base::Random& random) {
  return mean < 30.0 ? poisson_by_products(mean, random) : poisson_by_rejection(mean, random);
}

void add_gaussian_noise(std::span<float> image, std::int64_t width, double sigma,
                        std::uint64_t seed, std::uint64_t first_stream) {
  for_each_pixel(image, width, seed, first_stream, [sigma](double value, base::Random& random) {
    return value + sigma * random.normal();
  });
}

void add_blurred_noise(std::span<float> image, std::int64_t width, double sigma, double blur_px,
                       std::uint64_t seed, std::uint64_t first_stream) {
  const std::int64_t height = std::ssize(image) / width;
  std::vector<float> white(image.size());
  add_gaussian_noise(white, width, sigma, seed, first_stream);
  const fourier::ImageTransform transform(width, height);
  fourier::ImageTransform::Image noise(white.begin(), white.end());
  transform.forward(noise);
  double power = 0.0;
  for (std::int64_t y = 0; y < height; ++y)
    for (std::int64_t x = 0; x < width; ++x) {
      const double f =
          std::hypot(fourier::cycles_per_pixel(x, width), fourier::cycles_per_pixel(y, height));
      const double share = std::exp(-0.5 * std::pow(2.0 * std::numbers::pi * blur_px * f, 2));
      noise[static_cast<std::size_t>(y * width + x)] *= static_cast<float>(share);
      power += share * share;
    }
  transform.inverse(noise);
  const auto scale = static_cast<float>(std::sqrt(static_cast<double>(image.size()) / power));
  for (std::size_t i = 0; i < image.size(); ++i) image[i] += scale * noise[i].real();
}

void draw_counts(std::span<float> image, std::int64_t width, std::uint64_t seed,
                 std::uint64_t first_stream) {
  for_each_pixel(image, width, seed, first_stream, [](double value, base::Random& random) {
    return static_cast<double>(poisson(value, random));
  });
}

}  // namespace tomofield::simulate
