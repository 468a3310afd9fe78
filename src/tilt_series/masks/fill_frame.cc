#include "tilt_series/masks/fill_frame.h"

#include <numbers>

namespace tomofield::tilt_series {
namespace {

constexpr double kDegree = std::numbers::pi / 180.0;
constexpr double kMaxRotation_deg = 15.0;

/// The largest sum over the first elements of a sequence, and how many these are.
struct Beginning {
  std::int64_t sum = 0;
  std::int64_t length = 0;
};

template <typename Iterator>
Beginning best_beginning(Iterator first, Iterator last) {
  Beginning best;
  std::int64_t sum = 0, length = 0;
  for (Iterator at = first; at != last; ++at) {
    sum += *at;
    ++length;
    if (sum > best.sum) best = {sum, length};
  }
  return best;
}

std::vector<std::int64_t> sums_of_strips(const SampleGrid& grid, const std::vector<int>& votes,
                                         double angle_rad) {
  std::vector<std::int64_t> strips(static_cast<std::size_t>(grid.num_strips()));
  visit_strips(grid, angle_rad,
               [&](std::size_t index, std::size_t strip) { strips[strip] += votes[index]; });
  return strips;
}

/// Counts the votes for a rectangle at this rotation with the best four offsets.
std::int64_t score_rotation(const SampleGrid& grid, const std::vector<int>& votes,
                            double rotation_rad) {
  std::int64_t score = 0;
  for (const double angle_rad : {rotation_rad, rotation_rad + 90.0 * kDegree}) {
    const std::vector<std::int64_t> strips = sums_of_strips(grid, votes, angle_rad);
    score += best_beginning(strips.begin(), strips.end()).sum;
    score += best_beginning(strips.rbegin(), strips.rend()).sum;
  }
  return score;
}

}  // namespace

FillFrame best_frame(const SampleGrid& grid, const std::vector<int>& votes) {
  FillFrame best;
  const auto try_around = [&](double middle_rad, double reach_rad, double step_rad) {
    const auto num_steps = std::lround(reach_rad / step_rad);
    for (std::int64_t i = -num_steps; i <= num_steps; ++i) {
      const double angle_rad = middle_rad + static_cast<double>(i) * step_rad;
      const std::int64_t score = score_rotation(grid, votes, angle_rad);
      if (score > best.votes) best = {angle_rad, score};
    }
  };
  try_around(0.0, kMaxRotation_deg * kDegree, 1.0 * kDegree);
  try_around(best.rotation_rad, 0.9 * kDegree, 0.1 * kDegree);
  return best;
}

std::int64_t depth_of_fill(const SampleGrid& grid, const std::vector<int>& votes,
                           double angle_rad) {
  const std::vector<std::int64_t> strips = sums_of_strips(grid, votes, angle_rad);
  return best_beginning(strips.begin(), strips.end()).length;
}

}  // namespace tomofield::tilt_series
