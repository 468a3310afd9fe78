#include "tilt_series/masks/correlation.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <utility>

#include "base/statistics.h"
#include "tilt_series/resampling/binning.h"
#include "tilt_series/resampling/box_sums.h"

namespace tomofield::tilt_series {
namespace {

constexpr std::int64_t kNear_px = 3;
constexpr std::int64_t kLocalMean_px = 8;
constexpr double kMostNoises = 4.0;

/// Returns the variance of valid pixels from their median square, which ignores the largest ones.
double robust_variance(const MaskedImage& image) {
  constexpr double kMedianOfSquare = 0.4549;  // of a normal distribution of variance 1
  constexpr std::size_t kEnough = 1 << 18;
  const std::size_t step = image.values.size() / kEnough + 1;
  std::vector<float> squares;
  for (std::size_t i = 0; i < image.values.size(); i += step)
    if (image.valid[i]) squares.push_back(image.values[i] * image.values[i]);
  return squares.empty() ? 0.0 : base::percentile(std::move(squares), 50.0) / kMedianOfSquare;
}

}  // namespace

Correlation::Correlation(MaskedImage of) : image(std::move(of)), variances(image), products(image) {
  MaskedImage detail = image;
  {
    const std::vector<float> sums = box_sums(image.values, image.width, kLocalMean_px);
    const std::vector<float> counts = box_sums(image.valid, image.width, kLocalMean_px);
    for (std::size_t i = 0; i < image.values.size(); ++i)
      if (image.valid[i]) detail.values[i] -= sums[i] / counts[i];
  }
  constexpr float kNumAround = (2 * kNear_px + 1) * (2 * kNear_px + 1) - 1;
  noise = robust_variance(detail) / std::sqrt(kNumAround);
  const auto most = static_cast<float>(kMostNoises * noise);
  const std::vector<float> sums = box_sums(detail.values, image.width, kNear_px);
  const std::vector<float> counts = box_sums(image.valid, image.width, kNear_px);
  for (std::size_t i = 0; i < detail.values.size(); ++i) {
    image.valid[i] = image.valid[i] && counts[i] > kNumAround / 2;
    const float own = detail.values[i];
    const float product = own * (sums[i] - own) / std::max(counts[i] - 1.0f, 1.0f);
    variances.values[i] = own * own;
    products.values[i] = std::clamp(product, -most, most);
  }
  variances.valid = image.valid;
  products.valid = image.valid;
}

void Correlation::reduce(double factor) {
  for (MaskedImage* map : {&image, &variances, &products}) *map = reduce_image(*map, factor);
  noise /= factor;
}

void CorrelationSum::operator+=(const CorrelationSum& other) {
  products_ += other.products_;
  values_ += other.values_;
  squares_ += other.squares_;
  variances_ += other.variances_;
  count_ += other.count_;
}

double CorrelationSum::deviation() const {
  return std::sqrt(std::max(0.0, squares_ / count_ - mean() * mean()));
}

double CorrelationSum::error(const Correlation& of) const {
  return std::numbers::sqrt2 * of.noise / std::sqrt(count_);  // each pair is in two products
}

}  // namespace tomofield::tilt_series
