#include "align/blur.h"

#include <algorithm>
#include <cmath>

namespace tomofield::align {
namespace {

std::vector<float> kernel_of(double sigma_px) {
  constexpr double kReach = 3.5;  // standard deviations
  const auto reach = static_cast<std::int64_t>(std::ceil(kReach * sigma_px));
  std::vector<float> kernel;
  double sum = 0.0;
  for (std::int64_t i = -reach; i <= reach; ++i) {
    const double at = static_cast<double>(i) / sigma_px;
    kernel.push_back(static_cast<float>(std::exp(-0.5 * at * at)));
    sum += static_cast<double>(kernel.back());
  }
  for (float& weight : kernel) weight = static_cast<float>(static_cast<double>(weight) / sum);
  return kernel;
}

// Adds to each pixel the pixels of its row, weighted by the kernel.
void blur_rows(std::span<const float> from, std::int64_t width, std::span<const float> kernel,
               std::vector<float>& to) {
  const std::int64_t reach = std::ssize(kernel) / 2, height = std::ssize(from) / width;
  std::vector<float> padded(static_cast<std::size_t>(width + 2 * reach));
  for (std::int64_t y = 0; y < height; ++y) {
    const float* row = from.data() + y * width;
    std::fill_n(padded.begin(), reach, row[0]);
    std::copy_n(row, width, padded.begin() + reach);
    std::fill_n(padded.begin() + reach + width, reach, row[width - 1]);
    float* out = to.data() + y * width;
    for (std::size_t k = 0; k < kernel.size(); ++k)
      for (std::int64_t x = 0; x < width; ++x)
        out[x] += kernel[k] * padded[k + static_cast<std::size_t>(x)];
  }
}

// Adds to each pixel the pixels of its column, weighted by the kernel.
void blur_columns(std::span<const float> from, std::int64_t width, std::span<const float> kernel,
                  std::vector<float>& to) {
  const std::int64_t reach = std::ssize(kernel) / 2, height = std::ssize(from) / width;
  for (std::int64_t y = 0; y < height; ++y) {
    float* out = to.data() + y * width;
    for (std::int64_t k = -reach; k <= reach; ++k) {
      const float weight = kernel[static_cast<std::size_t>(k + reach)];
      const float* row = from.data() + std::clamp<std::int64_t>(y + k, 0, height - 1) * width;
      for (std::int64_t x = 0; x < width; ++x) out[x] += weight * row[x];
    }
  }
}

}  // namespace

std::vector<float> gaussian_blur(std::span<const float> image, std::int64_t width,
                                 double sigma_px) {
  if (sigma_px <= 0.0) return {image.begin(), image.end()};
  const std::vector<float> kernel = kernel_of(sigma_px);
  std::vector<float> rows(image.size()), blurred(image.size());
  blur_rows(image, width, kernel, rows);
  blur_columns(rows, width, kernel, blurred);
  return blurred;
}

}  // namespace tomofield::align
