#include "tilt_series/masks/straight_fill.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "base/statistics.h"

namespace tomofield::tilt_series {
namespace {

constexpr std::int64_t kSmallestImage_px = 64;
constexpr std::int64_t kBoxRadius_px = 2;
constexpr std::int64_t kRim_px = 2;  // often blurred, never looked at
constexpr std::int64_t kCorner_px = 8;
constexpr std::int64_t kMaxSamples = 512;  // a side
constexpr double kDegree = std::numbers::pi / 180.0;
constexpr int kPenalty = 10;         // so fill is strips with > 10/11 of it
constexpr double kMaxSpread = 0.3;   // of a corner, in standard deviations of the image
constexpr double kMinDarker = 0.05;  // part of a bright image that is darker than fill
constexpr double kMinLength = 0.9;   // of all sides, relative to the shorter one of the image
constexpr double kMaxAlikeWithin = 0.4;
constexpr double kMaxAlikeOneSide = 0.85;   // beside others that are clear
constexpr double kMaxRoughness = 0.85;      // relative to the rest of the image
constexpr std::int64_t kBlurredStrips = 4;  // between fill and what is judged within
constexpr std::int64_t kJudgedStrips = 8;
// Sides are found where 5 × 5 means stop being flat, 2 px before the fill ends,
// to about 1 px; 2 px of blur come on top.
constexpr double kEdge_px = 2.0 + 1.0 + 2.0;

/// The box means of an image on a grid of pixels.
struct Samples {
  SampleGrid grid;
  std::vector<float> means;         // [row, column]
  std::vector<std::uint8_t> known;  // whether the whole box was measured
};

struct Statistics {
  double mean = 0.0;
  double deviation = 0.0;
  std::int64_t num_invalid = 0;
};

/// Returns the moments of the pixels in the box of `size` × `size` from (x0, y0).
Statistics box_statistics(const MaskedImage& image, std::int64_t x0, std::int64_t y0,
                          std::int64_t size) {
  Statistics result;
  double sum = 0.0, sum_squares = 0.0;
  const double origin = image.values[image.index(x0, y0)];  // against cancellation
  for (std::int64_t y = y0; y < y0 + size; ++y) {
    for (std::int64_t x = x0; x < x0 + size; ++x) {
      const double value = image.values[image.index(x, y)] - origin;
      sum += value;
      sum_squares += value * value;
      result.num_invalid += image.valid[image.index(x, y)] == 0;
    }
  }
  const auto count = static_cast<double>(size * size);
  const double mean = sum / count;
  result.mean = origin + mean;
  result.deviation = std::sqrt(std::max(0.0, sum_squares / count - mean * mean));
  return result;
}

Samples take_samples(const MaskedImage& image) {
  Samples samples;
  constexpr std::int64_t box_px = 2 * kBoxRadius_px + 1;
  const std::int64_t width = image.width - 2 * kRim_px - box_px;
  const std::int64_t height = image.height - 2 * kRim_px - box_px;
  const std::int64_t step_px =
      std::max<std::int64_t>(1, (std::max(width, height) - 1) / kMaxSamples + 1);
  const std::int64_t columns = width / step_px + 1, rows = height / step_px + 1;
  samples.grid = {columns, rows, static_cast<double>(step_px)};
  const std::int64_t x0 = (image.width - box_px - (columns - 1) * step_px) / 2;
  const std::int64_t y0 = (image.height - box_px - (rows - 1) * step_px) / 2;
  for (std::int64_t row = 0; row < rows; ++row) {
    for (std::int64_t column = 0; column < columns; ++column) {
      const Statistics box =
          box_statistics(image, x0 + column * step_px, y0 + row * step_px, box_px);
      samples.means.push_back(static_cast<float>(box.mean));
      samples.known.push_back(box.num_invalid == 0);
    }
  }
  return samples;
}

double standard_deviation(const std::vector<float>& values) {
  double sum = 0.0, sum_squares = 0.0;
  for (const float value : values) sum += value;
  const double mean = sum / static_cast<double>(values.size());
  for (const float value : values) sum_squares += (value - mean) * (value - mean);
  return std::sqrt(sum_squares / static_cast<double>(values.size()));
}

/// Tells whether one of the image's outermost rows and columns has one value only.
bool has_constant_edge(const MaskedImage& image) {
  const auto is_constant = [&](std::int64_t x, std::int64_t y, bool is_row) {
    const float first = image.values[image.index(x, y)];
    for (std::int64_t i = 0; i < (is_row ? image.width : image.height); ++i) {
      if (image.values[is_row ? image.index(i, y) : image.index(x, i)] != first) return false;
    }
    return true;
  };
  return is_constant(0, 0, true) || is_constant(0, image.height - 1, true) ||
         is_constant(0, 0, false) || is_constant(image.width - 1, 0, false);
}

/// Tells whether a corner is one of the darkest places of the image.
bool is_darkest(const Samples& samples, const Statistics& corner) {
  const auto num_darker =
      std::count_if(samples.means.begin(), samples.means.end(),
                    [&](float mean) { return mean < corner.mean - corner.deviation; });
  return static_cast<double>(num_darker) < kMinDarker * static_cast<double>(samples.means.size());
}

/// Returns the corners of the image that can be fill.
std::vector<Statistics> flat_corners(Contrast contrast, const MaskedImage& image,
                                     const Samples& samples) {
  std::vector<Statistics> corners;
  const double image_deviation = standard_deviation(samples.means);
  for (const std::int64_t y : {kRim_px, image.height - kRim_px - kCorner_px}) {
    for (const std::int64_t x : {kRim_px, image.width - kRim_px - kCorner_px}) {
      const Statistics corner = box_statistics(image, x, y, kCorner_px);
      if (corner.num_invalid > 0 || corner.deviation > kMaxSpread * image_deviation) continue;
      if (contrast == Contrast::kBright && is_darkest(samples, corner)) continue;
      corners.push_back(corner);
    }
  }
  return corners;
}

/// Returns a vote of each sample: 1 if it is like one of the corners that agree with
/// `corner`, −kPenalty if not, 0 if it is unknown.
std::vector<int> vote(const Samples& samples, const std::vector<Statistics>& corners,
                      const Statistics& corner) {
  std::vector<int> votes(samples.means.size(), -kPenalty);
  for (const Statistics& other : corners) {
    if (std::abs(other.mean - corner.mean) > other.deviation + corner.deviation) continue;
    for (std::size_t i = 0; i < votes.size(); ++i) {
      if (std::abs(samples.means[i] - other.mean) <= other.deviation) votes[i] = 1;
    }
  }
  for (std::size_t i = 0; i < votes.size(); ++i) {
    if (!samples.known[i]) votes[i] = 0;
  }
  return votes;
}

/// A side as it was found, in strips.
struct FoundSide {
  double angle_rad = 0.0;
  std::int64_t depth = 0;     // strips of fill
  double length = 0.0;        // samples in the last of them
  double alike_within = 1.0;  // part like the fill of what lies just within
};

FoundSide find_side(const Samples& samples, const std::vector<int>& votes, double angle_rad) {
  const std::int64_t num_strips = samples.grid.num_strips();
  std::vector<int> num_known(static_cast<std::size_t>(num_strips)), num_alike(num_known.size());
  visit_strips(samples.grid, angle_rad, [&](std::size_t index, std::size_t strip) {
    num_known[strip] += votes[index] != 0;
    num_alike[strip] += votes[index] == 1;
  });
  FoundSide side{angle_rad, depth_of_fill(samples.grid, votes, angle_rad)};
  if (side.depth == 0) return side;
  side.length = num_known[static_cast<std::size_t>(side.depth - 1)];
  const std::int64_t first = std::min(side.depth + kBlurredStrips, num_strips);
  const std::int64_t last = std::min(first + kJudgedStrips, num_strips);
  double known = 0.0, alike = 0.0;
  for (auto strip = static_cast<std::size_t>(first); strip < static_cast<std::size_t>(last);
       ++strip) {
    known += num_known[strip];
    alike += num_alike[strip];
  }
  if (known > 0.0) side.alike_within = alike / known;
  return side;
}

/// Returns how much neighbouring, separate boxes differ in the fill, relative to
/// elsewhere.
double roughness_of_fill(const Samples& samples, const std::vector<FoundSide>& sides) {
  std::vector<std::uint8_t> is_fill(samples.means.size());
  for (const FoundSide& side : sides) {
    visit_strips(samples.grid, side.angle_rad, [&](std::size_t index, std::size_t strip) {
      if (strip < static_cast<std::size_t>(side.depth)) is_fill[index] = 1;
    });
  }
  const auto step_px = static_cast<std::int64_t>(samples.grid.step_px);
  const std::int64_t apart = 2 * kBoxRadius_px / step_px + 1;
  std::vector<float> in_fill, elsewhere;
  for (std::int64_t row = 0; row < samples.grid.rows; ++row) {
    for (std::int64_t column = apart; column < samples.grid.columns; ++column) {
      const auto right = static_cast<std::size_t>(row * samples.grid.columns + column);
      const std::size_t left = right - static_cast<std::size_t>(apart);
      if (is_fill[left] != is_fill[right] || !samples.known[left] || !samples.known[right]) {
        continue;
      }
      (is_fill[left] ? in_fill : elsewhere)
          .push_back(std::abs(samples.means[left] - samples.means[right]));
    }
  }
  const double rest = base::median_in_place(elsewhere);
  return rest > 0.0 ? base::median_in_place(in_fill) / rest : 1.0;
}

/// Returns the sides of the rectangle that are clear, or none if together they are too short.
std::vector<FoundSide> convincing_sides(const Samples& samples, const std::vector<int>& votes,
                                        double rotation_rad) {
  std::vector<FoundSide> sides;
  double length = 0.0, alike = 0.0;
  for (const double quarter_deg : {0.0, 90.0, 180.0, 270.0}) {
    const FoundSide side = find_side(samples, votes, rotation_rad + quarter_deg * kDegree);
    if (side.depth == 0 || side.alike_within > kMaxAlikeOneSide) continue;
    sides.push_back(side);
    length += side.length;
    alike += side.length * side.alike_within;
  }
  const auto shorter = static_cast<double>(std::min(samples.grid.columns, samples.grid.rows));
  if (length < kMinLength * shorter || alike > kMaxAlikeWithin * length) return {};
  if (roughness_of_fill(samples, sides) > kMaxRoughness) return {};
  return sides;
}

}  // namespace

std::vector<FillSide> find_straight_fill(Contrast contrast, const MaskedImage& image) {
  if (std::min(image.width, image.height) < kSmallestImage_px) return {};
  if (has_constant_edge(image)) return {};
  const Samples samples = take_samples(image);
  const std::vector<Statistics> corners = flat_corners(contrast, image, samples);
  std::vector<std::vector<int>> tried;
  FillFrame best;
  std::vector<int> best_votes;
  for (const Statistics& corner : corners) {
    const std::vector<int> votes = vote(samples, corners, corner);
    if (std::find(tried.begin(), tried.end(), votes) != tried.end()) continue;
    const FillFrame frame = best_frame(samples.grid, votes);
    if (frame.votes > best.votes) {
      best = frame;
      best_votes = votes;
    }
    tried.push_back(votes);
  }
  if (best.votes == 0) return {};
  std::vector<FillSide> sides;
  for (const FoundSide& side : convincing_sides(samples, best_votes, best.rotation_rad)) {
    // The next strip may be mixed.
    const double offset_px = samples.grid.offset_px(side.depth + 1) - 1.0;
    sides.push_back({side.angle_rad, offset_px, kEdge_px});
  }
  return sides;
}

}  // namespace tomofield::tilt_series
