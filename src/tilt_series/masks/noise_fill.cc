#include "tilt_series/masks/noise_fill.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>

#include "base/percentile.h"
#include "tilt_series/binning.h"

namespace tomofield::tilt_series {
namespace {

constexpr std::int64_t kSmallestImage_px = 64;
constexpr double kLargestImage_px = 512.0;
constexpr std::int64_t kNear_px = 2;       // pixels around whose correlation counts
constexpr std::int64_t kLocalMean_px = 10;  // reach of the mean that is subtracted
constexpr int kBlocks = 8;                 // a side, of the image's middle
constexpr double kMiddleBegins = 0.15;     // of the image's sides
constexpr double kWeakestPercent = 25.0;
constexpr double kMostNoises = 4.0;   // of one product
constexpr double kVoteScale = 16.0;   // a noise
constexpr double kClear = 8.0;        // standard errors
constexpr double kMaxInFill = 0.2;    // correlation, relative to the image's
constexpr double kMinWithin = 0.5;
constexpr int kSegments = 8;  // of a side
constexpr double kMinSegments = 0.75;
constexpr double kMinLength = 0.9;     // of all sides, relative to the image's shorter one
constexpr double kMaxStep = 0.5;       // of the mean, in standard deviations of the image
constexpr double kMaxVariances = 2.0;  // ratio of fill and image, either way
constexpr std::int64_t kEdge_px = 4;
constexpr std::int64_t kBlurredStrips = 3;
constexpr std::int64_t kJudgedStrips = 12;
constexpr double kBlur_px = 2.0;  // binned

/// Sums over the boxes of pixels within `reach` of each pixel, and their counts.
struct BoxSums {
  std::vector<double> values;
  std::vector<std::int32_t> counts;
};

/// Adds up runs of 2 · reach + 1 elements around each element, `stride` apart.
template <typename T>
void run_sums(std::vector<T>* values, std::size_t first, std::size_t stride, std::int64_t count,
              std::int64_t reach) {
  std::vector<T> line;
  const auto at = [&](std::int64_t i) { return first + static_cast<std::size_t>(i) * stride; };
  for (std::int64_t i = 0; i < count; ++i) line.push_back((*values)[at(i)]);
  T sum{};
  for (std::int64_t i = 0; i < std::min(reach, count); ++i) sum += line[static_cast<std::size_t>(i)];
  for (std::int64_t i = 0; i < count; ++i) {
    if (i + reach < count) sum += line[static_cast<std::size_t>(i + reach)];
    if (i - reach > 0) sum -= line[static_cast<std::size_t>(i - reach - 1)];
    (*values)[at(i)] = sum;
  }
}

BoxSums box_sums(const MaskedImage& image, std::int64_t reach) {
  BoxSums sums{{image.values.begin(), image.values.end()}, {image.valid.begin(), image.valid.end()}};
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

/// What tells noise from image at each pixel.
struct Evidence {
  MaskedImage image;            // binned
  std::vector<float> detail;    // less a local mean
  std::vector<float> products;  // with the mean of the pixels around, clipped
  std::vector<std::uint8_t> known;
  double product_noise = 0.0;  // standard deviation of a product of white noise

  SampleGrid grid(double bin_factor) const { return {image.width, image.height, bin_factor}; }
};

double median_square(const std::vector<float>& values, const std::vector<std::uint8_t>& valid) {
  std::vector<float> squares;
  for (std::size_t i = 0; i < values.size(); ++i)
    if (valid[i]) squares.push_back(values[i] * values[i]);
  return squares.empty() ? 0.0 : base::percentile(std::move(squares), 50.0);
}

Evidence gather_evidence(MaskedImage binned) {
  Evidence evidence;
  evidence.image = std::move(binned);
  const MaskedImage& image = evidence.image;
  const BoxSums local = box_sums(image, kLocalMean_px);
  MaskedImage detail = image;
  for (std::size_t i = 0; i < detail.values.size(); ++i)
    if (image.valid[i]) detail.values[i] -= static_cast<float>(local.values[i] / local.counts[i]);
  const BoxSums around = box_sums(detail, kNear_px);
  constexpr double kMedianOfSquare = 0.4549;  // of a normal distribution of variance 1
  constexpr double kNumAround = (2 * kNear_px + 1) * (2 * kNear_px + 1) - 1;
  const double variance = median_square(detail.values, image.valid) / kMedianOfSquare;
  evidence.product_noise = variance / std::sqrt(kNumAround);
  const double most = kMostNoises * evidence.product_noise;
  for (std::size_t i = 0; i < detail.values.size(); ++i) {
    const double own = detail.values[i], others = around.values[i] - own;
    evidence.known.push_back(image.valid[i] && around.counts[i] > kNumAround / 2);
    const double product = own * others / std::max(around.counts[i] - 1, 1);
    evidence.products.push_back(static_cast<float>(std::clamp(product, -most, most)));
  }
  evidence.detail = std::move(detail.values);
  return evidence;
}

/// Adds up what some pixels have.
struct Sum {
  double products = 0.0, values = 0.0, squares = 0.0, variance = 0.0, count = 0.0;

  void add(const Evidence& evidence, std::size_t index) {
    if (!evidence.known[index]) return;
    const double value = evidence.image.values[index], detail = evidence.detail[index];
    products += evidence.products[index];
    values += value;
    squares += value * value;
    variance += detail * detail;
    count += 1.0;
  }
  double product() const { return products / count; }
  double mean() const { return values / count; }
  double deviation() const {
    return std::sqrt(std::max(0.0, squares / count - mean() * mean()));
  }
  /// Returns the standard error of product(); each pair of pixels is in two products.
  double error(const Evidence& evidence) const {
    return std::numbers::sqrt2 * evidence.product_noise / std::sqrt(count);
  }
};

/// Returns the mean product that three quarters of the blocks of the image's middle exceed, or 0 if
/// that is not clear of noise.
double weak_product(const Evidence& evidence) {
  const auto first_of = [](std::int64_t size, int block) {
    const double part = kMiddleBegins + (1.0 - 2.0 * kMiddleBegins) * block / kBlocks;
    return static_cast<std::int64_t>(part * static_cast<double>(size));
  };
  const MaskedImage& image = evidence.image;
  std::vector<float> products;
  double error = 0.0;
  for (int row = 0; row < kBlocks; ++row) {
    for (int column = 0; column < kBlocks; ++column) {
      Sum sum;
      for (std::int64_t y = first_of(image.height, row); y < first_of(image.height, row + 1); ++y)
        for (std::int64_t x = first_of(image.width, column); x < first_of(image.width, column + 1);
             ++x)
          sum.add(evidence, image.index(x, y));
      if (sum.count == 0.0) continue;
      products.push_back(static_cast<float>(sum.product()));
      error = std::max(error, sum.error(evidence));
    }
  }
  if (products.empty()) return 0.0;
  const double weak = base::percentile(std::move(products), kWeakestPercent);
  return weak > error ? weak : 0.0;
}

/// Tells whether one of the image's four edges is uncorrelated, as it is where fill begins there.
bool has_uncorrelated_edge(const Evidence& evidence, double weak) {
  std::array<Sum, 4> edges;
  const MaskedImage& image = evidence.image;
  for (std::int64_t y = 0; y < image.height; ++y) {
    for (std::int64_t x = 0; x < image.width; ++x) {
      const std::array<std::int64_t, 4> depth{x, y, image.width - 1 - x, image.height - 1 - y};
      for (std::size_t edge = 0; edge < edges.size(); ++edge)
        if (depth[edge] < kEdge_px) edges[edge].add(evidence, image.index(x, y));
    }
  }
  return std::any_of(edges.begin(), edges.end(), [&](const Sum& edge) {
    return edge.product() < 0.5 * weak + edge.error(evidence);
  });
}

std::vector<int> vote(const Evidence& evidence, double weak) {
  std::vector<int> votes;
  for (std::size_t i = 0; i < evidence.products.size(); ++i) {
    const double vote = (0.5 * weak - evidence.products[i]) * kVoteScale / evidence.product_noise;
    votes.push_back(evidence.known[i] ? static_cast<int>(std::lround(vote)) : 0);
  }
  return votes;
}

/// A side, and the pixels on both sides of its edge.
struct JudgedSide {
  double angle_rad = 0.0;
  std::int64_t depth = 0;
  double length = 0.0;  // pixels in the last strip of fill
  Sum fill;             // all of it
  Sum fill_near;        // in the last strips
  Sum image_near;       // in the first strips
  std::array<Sum, kSegments> segments;  // of image_near, along the side
};

JudgedSide judge_side(const Evidence& evidence, const std::vector<int>& votes, double angle_rad) {
  const SampleGrid grid = evidence.grid(1.0);
  JudgedSide side{angle_rad, depth_of_fill(grid, votes, angle_rad), {}, {}, {}, {}, {}};
  if (side.depth == 0) return side;
  const std::int64_t image_begin = side.depth + kBlurredStrips;
  const auto position_along = [&](std::size_t index) {
    const auto x = static_cast<double>(static_cast<std::int64_t>(index) % grid.columns);
    const auto y = static_cast<double>(static_cast<std::int64_t>(index) / grid.columns);
    return y * std::cos(angle_rad) - x * std::sin(angle_rad);
  };
  std::vector<std::size_t> near;
  visit_strips(grid, angle_rad, [&](std::size_t index, std::size_t at) {
    const auto strip = static_cast<std::int64_t>(at);
    if (strip < side.depth) side.fill.add(evidence, index);
    if (strip < side.depth && strip >= side.depth - kJudgedStrips)
      side.fill_near.add(evidence, index);
    side.length += strip == side.depth - 1 && evidence.known[index];
    if (strip >= image_begin && strip < image_begin + kJudgedStrips && evidence.known[index])
      near.push_back(index);
  });
  if (near.empty()) return side;
  double begin = position_along(near.front()), end = begin;
  for (const std::size_t index : near) {
    begin = std::min(begin, position_along(index));
    end = std::max(end, position_along(index));
  }
  for (const std::size_t index : near) {
    const double part = (position_along(index) - begin) / std::max(end - begin, 1.0);
    const int segment = std::min(static_cast<int>(part * kSegments), kSegments - 1);
    side.segments[static_cast<std::size_t>(segment)].add(evidence, index);
    side.image_near.add(evidence, index);
  }
  return side;
}

bool is_edge_of_image(const Evidence& evidence, const JudgedSide& side, double weak) {
  int num_correlated = 0;
  for (const Sum& segment : side.segments)
    num_correlated += segment.count > 0.0 && segment.product() > kMinWithin * weak;
  if (num_correlated < kMinSegments * kSegments) return false;
  Sum all;
  for (std::size_t i = 0; i < evidence.known.size(); ++i) all.add(evidence, i);
  if (std::fabs(side.fill_near.mean() - side.image_near.mean()) > kMaxStep * all.deviation())
    return false;
  const double ratio = (side.fill_near.variance / side.fill_near.count) /
                       (side.image_near.variance / side.image_near.count);
  return ratio < kMaxVariances && ratio > 1.0 / kMaxVariances;
}

bool is_uncorrelated(const Evidence& evidence, const Sum& fill, double weak) {
  return kClear * fill.error(evidence) < weak &&
         std::fabs(fill.product()) < kMaxInFill * weak + 2.0 * fill.error(evidence);
}

}  // namespace

std::vector<FillSide> find_noise_fill(const MaskedImage& image) {
  const auto larger = static_cast<double>(std::max(image.width, image.height));
  const double bin_factor = std::max(1.0, larger / kLargestImage_px);
  const Evidence evidence = gather_evidence(reduce_image(image, bin_factor));
  const std::int64_t shorter = std::min(evidence.image.width, evidence.image.height);
  if (shorter < kSmallestImage_px) return {};
  const double weak = weak_product(evidence);
  if (!(weak > 0.0) || !has_uncorrelated_edge(evidence, weak)) return {};
  const std::vector<int> votes = vote(evidence, weak);
  const FillFrame frame = best_frame(evidence.grid(1.0), votes);
  if (frame.votes == 0) return {};
  std::vector<FillSide> sides;
  Sum fill;
  double length = 0.0;
  for (const double quarter_rad : {0.0, 0.5, 1.0, 1.5}) {
    const JudgedSide side =
        judge_side(evidence, votes, frame.rotation_rad + quarter_rad * std::numbers::pi);
    if (side.depth == 0 || !is_edge_of_image(evidence, side, weak)) continue;
    length += side.length;
    fill.products += side.fill.products;
    fill.count += side.fill.count;
    sides.push_back({side.angle_rad, evidence.grid(bin_factor).offset_px(side.depth),
                     kBlur_px * bin_factor});
  }
  if (length < kMinLength * static_cast<double>(shorter)) return {};
  if (!is_uncorrelated(evidence, fill, weak)) return {};
  return sides;
}

}  // namespace tomofield::tilt_series
