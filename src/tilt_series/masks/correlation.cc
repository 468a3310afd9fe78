#include "tilt_series/masks/correlation.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <utility>

#include "base/percentile.h"
#include "tilt_series/binning.h"

namespace tomofield::tilt_series {
namespace {

constexpr std::int64_t kNear_px = 3;
constexpr std::int64_t kLocalMean_px = 8;
constexpr double kMostNoises = 4.0;

/// Sums over the boxes of pixels within some reach of each pixel, and the counts of measured ones.
struct BoxSums {
  std::vector<double> values;
  std::vector<std::int32_t> counts;
};

/// Adds up runs of 2 · reach + 1 elements around each of `count` elements, `stride` apart.
template <typename T>
void run_sums(std::vector<T>* values, std::size_t first, std::size_t stride, std::int64_t count,
              std::int64_t reach) {
  std::vector<T> line;
  const auto at = [&](std::int64_t i) { return first + static_cast<std::size_t>(i) * stride; };
  for (std::int64_t i = 0; i < count; ++i) line.push_back((*values)[at(i)]);
  T sum{};
  for (std::int64_t i = 0; i < std::min(reach, count); ++i)
    sum += line[static_cast<std::size_t>(i)];
  for (std::int64_t i = 0; i < count; ++i) {
    if (i + reach < count) sum += line[static_cast<std::size_t>(i + reach)];
    if (i - reach > 0) sum -= line[static_cast<std::size_t>(i - reach - 1)];
    (*values)[at(i)] = sum;
  }
}

BoxSums box_sums(const MaskedImage& image, std::int64_t reach) {
  BoxSums sums{{image.values.begin(), image.values.end()},
               {image.valid.begin(), image.valid.end()}};
  for (std::int64_t y = 0; y < image.height; ++y) {
    run_sums(&sums.values, image.index(0, y), 1, image.width, reach);
    run_sums(&sums.counts, image.index(0, y), 1, image.width, reach);
  }
  const auto width = static_cast<std::size_t>(image.width);
  for (std::int64_t x = 0; x < image.width; ++x) {
    run_sums(&sums.values, image.index(x, 0), width, image.height, reach);
    run_sums(&sums.counts, image.index(x, 0), width, image.height, reach);
  }
  return sums;
}

/// Returns the variance of valid pixels from their median square, which ignores the largest ones.
double robust_variance(const MaskedImage& image) {
  constexpr double kMedianOfSquare = 0.4549;  // of a normal distribution of variance 1
  std::vector<float> squares;
  for (std::size_t i = 0; i < image.values.size(); ++i)
    if (image.valid[i]) squares.push_back(image.values[i] * image.values[i]);
  return squares.empty() ? 0.0 : base::percentile(std::move(squares), 50.0) / kMedianOfSquare;
}

}  // namespace

Correlation::Correlation(MaskedImage of) : image(std::move(of)), variances(image), products(image) {
  const BoxSums local = box_sums(image, kLocalMean_px);
  MaskedImage detail = image;
  for (std::size_t i = 0; i < image.values.size(); ++i)
    if (image.valid[i]) detail.values[i] -= static_cast<float>(local.values[i] / local.counts[i]);
  constexpr double kNumAround = (2 * kNear_px + 1) * (2 * kNear_px + 1) - 1;
  noise = robust_variance(detail) / std::sqrt(kNumAround);
  const double most = kMostNoises * noise;
  const BoxSums around = box_sums(detail, kNear_px);
  for (std::size_t i = 0; i < detail.values.size(); ++i) {
    image.valid[i] = image.valid[i] && around.counts[i] > kNumAround / 2;
    const double own = detail.values[i], others = around.values[i] - own;
    const double product = own * others / std::max(around.counts[i] - 1, 1);
    variances.values[i] = detail.values[i] * detail.values[i];
    products.values[i] = static_cast<float>(std::clamp(product, -most, most));
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
