#include "align/start/stretched_view.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <numbers>
#include <vector>

#include "geometry/raw_from_aligned.h"
#include "tilt_series/resampling/align_image.h"

namespace tomofield::alignment {
namespace {

using tilt_series::MaskedImage;

// Returns the right half of a Gaussian, from its centre to three standard deviations.
std::vector<double> half_gaussian(double sigma_px) {
  std::vector<double> weights;
  for (int i = 0; i <= std::ceil(3.0 * sigma_px); ++i)
    weights.push_back(std::exp(-0.5 * i * i / (sigma_px * sigma_px)));
  return weights;
}

// Convolves `count` lines of `length` values. Neighbours on a line are `step` apart, lines
// `stride`.
void blur_lines(std::vector<double>& values, std::int64_t count, std::int64_t stride,
                std::int64_t length, std::int64_t step, const std::vector<double>& kernel) {
  const std::int64_t radius = std::ssize(kernel) - 1;
  std::vector<double> line(static_cast<std::size_t>(length));
  for (std::int64_t l = 0; l < count; ++l) {
    double* first = values.data() + l * stride;
    for (std::int64_t i = 0; i < length; ++i) line[static_cast<std::size_t>(i)] = first[i * step];
    for (std::int64_t i = 0; i < length; ++i) {
      double sum = 0.0;
      for (auto j = std::max<std::int64_t>(0, i - radius); j <= std::min(length - 1, i + radius);
           ++j)
        sum +=
            kernel[static_cast<std::size_t>(std::abs(i - j))] * line[static_cast<std::size_t>(j)];
      first[i * step] = sum;
    }
  }
}

void blur(std::vector<double>& values, const MaskedImage& image,
          const std::vector<double>& kernel) {
  blur_lines(values, image.height, image.width, image.width, 1, kernel);
  blur_lines(values, image.width, 1, image.height, image.width, kernel);
}

double cosine_of(double deg) { return std::cos(deg * std::numbers::pi / 180.0); }

}  // namespace

MaskedImage without_trend(const MaskedImage& image, double sigma_px) {
  const std::vector<double> kernel = half_gaussian(sigma_px);
  std::vector<double> sums(image.values.size()), counts(image.values.size());
  for (std::size_t i = 0; i < sums.size(); ++i) {
    if (!image.valid[i]) continue;
    sums[i] = image.values[i];
    counts[i] = 1.0;
  }
  blur(sums, image, kernel);
  blur(counts, image, kernel);
  MaskedImage out = image;
  for (std::size_t i = 0; i < sums.size(); ++i)
    out.values[i] =
        image.valid[i] ? static_cast<float>(image.values[i] - sums[i] / counts[i]) : 0.0f;
  return out;
}

MaskedImage stretched_view(const MaskedImage& image, const ViewPose& pose, double seen_at_deg,
                           std::int64_t width, std::int64_t height) {
  const double compress = cosine_of(pose.tilt_deg) / cosine_of(seen_at_deg);
  const geometry::RawFromAligned raw_from_stretched{
      compress, 0.0, 0.0, 1.0, pose.shift_px[0], pose.shift_px[1]};
  return tilt_series::align_image(image, raw_from_stretched, width, height);
}

}  // namespace tomofield::alignment
