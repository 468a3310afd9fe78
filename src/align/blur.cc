#include "align/blur.h"

#include <algorithm>

#include "base/gaussian_kernel.h"

namespace tomofield::alignment {
namespace {

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
  constexpr double kDeviations = 3.5;
  const std::vector<float> kernel = base::gaussian_kernel(sigma_px, kDeviations);
  std::vector<float> rows(image.size()), blurred(image.size());
  blur_rows(image, width, kernel, rows);
  blur_columns(rows, width, kernel, blurred);
  return blurred;
}

}  // namespace tomofield::alignment
