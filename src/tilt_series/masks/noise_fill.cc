#include "tilt_series/masks/noise_fill.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <utility>

#include "base/statistics.h"
#include "tilt_series/masks/correlation.h"
#include "tilt_series/resampling/binning.h"

namespace tomofield::tilt_series {
namespace {

constexpr std::int64_t kSmallestImage_px = 128;
constexpr double kLargestImage_px = 1536.0;  // a side; larger ones are binned
constexpr double kMostCells = 512.0;         // a side
constexpr int kBlocks = 8;                   // a side, of the image's middle
constexpr double kMiddleBegins = 0.15;       // of the image's sides
constexpr double kWeakestPercent = 25.0;
constexpr double kLevel = 0.7;       // of the image's correlation, above which a product is image
constexpr double kVoteScale = 16.0;  // a noise
constexpr double kClear = 8.0;       // standard errors
constexpr double kMaxInFill = 0.5;   // correlation, relative to the image's
constexpr double kMinWithin = 0.5;
constexpr int kSegments = 8;          // of a side
constexpr int kMinSegments = 5;       // that are clearly correlated
constexpr double kWhite = 0.15;       // as good as none
constexpr int kMaxWhiteSegments = 1;  // within a side
constexpr double kMinLength = 0.9;    // of all sides, relative to the image's shorter one
constexpr double kMaxStep = 0.5;      // of the mean, in standard deviations of the image
constexpr double kMinVariance = 0.5;  // of fill, relative to the image within
constexpr double kMaxVariance = 4.0;
constexpr std::int64_t kEdge_cells = 4;
constexpr std::int64_t kBlurredStrips = 3;
constexpr std::int64_t kJudgedStrips = 12;
constexpr double kBlur_cells = 2.0;

SampleGrid grid_of(const Correlation& pixels, double step_px) {
  return {pixels.image.width, pixels.image.height, step_px};
}

/// Returns the mean product that three quarters of the blocks of the image's middle exceed, or 0 if
/// that is not clear of noise.
double weak_product(const Correlation& pixels) {
  const auto first_of = [](std::int64_t size, int block) {
    const double part = kMiddleBegins + (1.0 - 2.0 * kMiddleBegins) * block / kBlocks;
    return static_cast<std::int64_t>(part * static_cast<double>(size));
  };
  const MaskedImage& image = pixels.image;
  std::vector<float> products;
  double error = 0.0;
  for (int row = 0; row < kBlocks; ++row) {
    for (int column = 0; column < kBlocks; ++column) {
      CorrelationSum sum;
      for (std::int64_t y = first_of(image.height, row); y < first_of(image.height, row + 1); ++y)
        for (std::int64_t x = first_of(image.width, column); x < first_of(image.width, column + 1);
             ++x)
          sum.add(pixels, image.index(x, y));
      if (sum.count() == 0.0) continue;
      products.push_back(static_cast<float>(sum.product()));
      error = std::max(error, sum.error(pixels));
    }
  }
  if (products.empty()) return 0.0;
  const double weak = base::percentile(std::move(products), kWeakestPercent);
  return weak > error ? weak : 0.0;
}

/// Tells whether one of the image's four edges is uncorrelated, as it is where fill begins there.
bool has_uncorrelated_edge(const Correlation& pixels, double weak) {
  std::array<CorrelationSum, 4> edges;
  const MaskedImage& image = pixels.image;
  for (std::int64_t y = 0; y < image.height; ++y) {
    for (std::int64_t x = 0; x < image.width; ++x) {
      const std::array<std::int64_t, 4> depth{x, y, image.width - 1 - x, image.height - 1 - y};
      for (std::size_t edge = 0; edge < edges.size(); ++edge)
        if (depth[edge] < kEdge_cells) edges[edge].add(pixels, image.index(x, y));
    }
  }
  return std::any_of(edges.begin(), edges.end(), [&](const CorrelationSum& edge) {
    return edge.product() < kLevel * weak + edge.error(pixels);
  });
}

std::vector<int> vote(const Correlation& pixels, double weak) {
  std::vector<int> votes;
  for (std::size_t i = 0; i < pixels.products.values.size(); ++i) {
    const double vote = (kLevel * weak - pixels.products.values[i]) * kVoteScale / pixels.noise;
    votes.push_back(pixels.image.valid[i] ? static_cast<int>(std::lround(vote)) : 0);
  }
  return votes;
}

/// Some strips along a side, in segments along it.
struct Band {
  std::array<CorrelationSum, kSegments> segments;
  CorrelationSum all;
};

/// A side, and the pixels on both sides of its edge.
struct JudgedSide {
  double angle_rad = 0.0;
  std::int64_t depth = 0;
  double length = 0.0;       // cells in the last strip of fill
  CorrelationSum fill;       // all of it
  CorrelationSum fill_near;  // the last strips
  Band image_near;           // the first strips beyond them
};

/// Adds up the strips [begin, end) of a side.
Band add_up_band(const Correlation& pixels, double angle_rad, std::int64_t begin,
                 std::int64_t end) {
  const SampleGrid grid = grid_of(pixels, 1.0);
  std::vector<std::pair<double, std::size_t>> places;  // along the side
  visit_strips(grid, angle_rad, [&](std::size_t index, std::size_t strip) {
    if (static_cast<std::int64_t>(strip) < begin || static_cast<std::int64_t>(strip) >= end) return;
    if (!pixels.image.valid[index]) return;
    const auto x = static_cast<double>(static_cast<std::int64_t>(index) % grid.columns);
    const auto y = static_cast<double>(static_cast<std::int64_t>(index) / grid.columns);
    places.emplace_back(y * std::cos(angle_rad) - x * std::sin(angle_rad), index);
  });
  Band band;
  if (places.empty()) return band;
  const auto [first, last] = std::minmax_element(places.begin(), places.end());
  const double length = std::max(last->first - first->first, 1.0), origin = first->first;
  for (const auto& [place, index] : places) {
    const int segment = static_cast<int>((place - origin) / length * kSegments);
    band.segments[static_cast<std::size_t>(std::min(segment, kSegments - 1))].add(pixels, index);
    band.all.add(pixels, index);
  }
  return band;
}

JudgedSide judge_side(const Correlation& pixels, const std::vector<int>& votes, double angle_rad) {
  const SampleGrid grid = grid_of(pixels, 1.0);
  JudgedSide side{angle_rad, depth_of_fill(grid, votes, angle_rad), 0.0, {}, {}, {}};
  if (side.depth == 0) return side;
  visit_strips(grid, angle_rad, [&](std::size_t index, std::size_t strip) {
    const auto outside = side.depth - static_cast<std::int64_t>(strip);  // 1: the last of the fill
    if (outside >= 1) side.fill.add(pixels, index);
    if (outside >= 1 && outside <= kJudgedStrips) side.fill_near.add(pixels, index);
    side.length += outside == 1 && pixels.image.valid[index];
  });
  const std::int64_t image_begin = side.depth + kBlurredStrips;
  side.image_near = add_up_band(pixels, angle_rad, image_begin, image_begin + kJudgedStrips);
  return side;
}

/// Tells whether cells have no more correlation than fill may have, as far as noise lets one see.
bool may_be_fill(const Correlation& pixels, const CorrelationSum& sum, double weak) {
  return sum.product() < kMaxInFill * weak + 2.0 * sum.error(pixels);
}

/// Tells whether cells clearly have no more correlation than fill may have.
bool is_fill(const Correlation& pixels, const CorrelationSum& sum, double weak) {
  return kClear * sum.error(pixels) < weak && sum.product() < kMaxInFill * weak;
}

/// Tells whether one side of an edge is correlated nearly everywhere, and the other nowhere.
bool is_edge_of_image(const Correlation& pixels, const JudgedSide& side, double weak) {
  int num_correlated = 0, num_white = 0;
  for (const CorrelationSum& segment : side.image_near.segments) {
    if (segment.count() == 0.0) continue;
    num_correlated += segment.product() > kMinWithin * weak;
    num_white += segment.product() < kWhite * weak;
  }
  if (num_correlated < kMinSegments || num_white > kMaxWhiteSegments) return false;
  return may_be_fill(pixels, side.fill_near, weak);
}

/// Tells whether pixels are alike on both sides of an edge but for their correlation.
bool are_alike(const Correlation& pixels, const JudgedSide& side) {
  CorrelationSum image;
  for (std::size_t i = 0; i < pixels.image.valid.size(); ++i) image.add(pixels, i);
  const CorrelationSum &outside = side.fill_near, &inside = side.image_near.all;
  if (std::fabs(outside.mean() - inside.mean()) > kMaxStep * image.deviation()) return false;
  const double ratio = outside.variance() / inside.variance();
  return ratio > kMinVariance && ratio < kMaxVariance;
}

bool stands(const Correlation& pixels, const JudgedSide& side, double weak) {
  return side.depth > 0 && is_edge_of_image(pixels, side, weak) && are_alike(pixels, side);
}

/// Tells whether the sides that stand are together long enough, with fill beyond.
bool are_convincing(const Correlation& pixels, const std::vector<JudgedSide>& sides, double weak) {
  CorrelationSum fill;
  double length = 0.0;
  for (const JudgedSide& side : sides) {
    if (!stands(pixels, side, weak)) continue;
    length += side.length;
    fill += side.fill;
  }
  const std::int64_t shorter = std::min(pixels.image.width, pixels.image.height);
  return length >= kMinLength * static_cast<double>(shorter) && is_fill(pixels, fill, weak);
}

}  // namespace

std::vector<FillSide> find_noise_fill(const MaskedImage& image) {
  if (std::min(image.width, image.height) < kSmallestImage_px) return {};
  const auto larger = static_cast<double>(std::max(image.width, image.height));
  const double bin_factor = std::max(1.0, larger / kLargestImage_px);
  const double cell_factor = std::max(1.0, larger / bin_factor / kMostCells);
  Correlation pixels(reduce_image(image, bin_factor));
  pixels.reduce(cell_factor);
  const double cell_px = bin_factor * cell_factor;
  const double weak = weak_product(pixels);
  if (!(weak > 0.0) || !has_uncorrelated_edge(pixels, weak)) return {};
  const std::vector<int> votes = vote(pixels, weak);
  const FillFrame frame = best_frame(grid_of(pixels, 1.0), votes);
  if (frame.votes == 0) return {};
  std::vector<JudgedSide> sides;
  for (const double quarter_rad : {0.0, 0.5, 1.0, 1.5}) {
    const double angle_rad = frame.rotation_rad + quarter_rad * std::numbers::pi;
    sides.push_back(judge_side(pixels, votes, angle_rad));
  }
  if (!are_convincing(pixels, sides, weak)) return {};
  std::vector<FillSide> found;
  for (const JudgedSide& side : sides) {
    if (!stands(pixels, side, weak) && !is_fill(pixels, side.fill, weak)) continue;
    found.push_back(
        {side.angle_rad, grid_of(pixels, cell_px).offset_px(side.depth), kBlur_cells * cell_px});
  }
  return found;
}

}  // namespace tomofield::tilt_series
