#include "tilt_series/fixed_pattern/pattern_search.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numeric>
#include <span>
#include <utility>

namespace tomofield::tilt_series {
namespace {

constexpr std::size_t kGroups = 3;
constexpr double kFewestPixelsMoved = 4.0;  // between the means of groups

/// Divides the views into groups of low, middle and high values.
std::vector<int> groups_by(const std::vector<double>& values) {
  std::vector<std::size_t> order(values.size());
  std::iota(order.begin(), order.end(), std::size_t{0});
  std::stable_sort(order.begin(), order.end(),
                   [&](std::size_t a, std::size_t b) { return values[a] < values[b]; });
  std::vector<int> groups(order.size());
  for (std::size_t i = 0; i < order.size(); ++i)
    groups[order[i]] = static_cast<int>(i * kGroups / order.size());
  return groups;
}

/// Tells whether the groups' mean values are far apart.
bool are_apart(const std::vector<double>& values, const std::vector<int>& groups) {
  std::array<double, kGroups> sums{}, counts{};
  for (std::size_t i = 0; i < values.size(); ++i) {
    sums[static_cast<std::size_t>(groups[i])] += values[i];
    counts[static_cast<std::size_t>(groups[i])] += 1.0;
  }
  for (std::size_t i = 0; i + 1 < kGroups; ++i)
    if (sums[i + 1] / counts[i + 1] - sums[i] / counts[i] < kFewestPixelsMoved) return false;
  return true;
}

/// Returns the lines of the stack's images along which the tilt axis lies, nearly.
Lines lines_along_axis(const SeriesPlan& plan) {
  const RawFromAligned& transform = plan.views.front().raw_from_aligned;
  const bool is_along_y = std::fabs(transform.m22) >= std::fabs(transform.m12);
  return is_along_y ? Lines::kColumns : Lines::kRows;
}

/// Gives the profiles of all views to all processes.
void share(std::int64_t num_lines, std::vector<LineProfiles>* views,
           const distributed::Communicator& processes) {
  for (LineProfiles& view : *views) {
    if (view.empty())
      view.assign(kLineParts, std::vector<float>(static_cast<std::size_t>(num_lines)));
    for (std::vector<float>& part : view) processes.allreduce_sum(std::span(part));
  }
}

}  // namespace

PatternSearch::PatternSearch(std::size_t num_views, std::int64_t width, std::int64_t height)
    : columns_{Lines::kColumns, width, std::vector<LineProfiles>(num_views)},
      rows_{Lines::kRows, height, std::vector<LineProfiles>(num_views)},
      pixels_(width, height) {}

void PatternSearch::add(std::size_t view, const MaskedImage& image) {
  columns_.of_view[view] = line_profiles(image, Lines::kColumns);
  rows_.of_view[view] = line_profiles(image, Lines::kRows);
  pixels_.add(image);
}

FixedPattern PatternSearch::find(const SeriesPlan& plan,
                                 const distributed::Communicator& processes) {
  return {find_lines(&columns_, plan, processes), find_lines(&rows_, plan, processes),
          pixels_.find(plan.views.size(), processes)};
}

std::vector<std::vector<float>> PatternSearch::find_lines(
    Profiles* profiles, const SeriesPlan& plan, const distributed::Communicator& processes) const {
  share(profiles->num_lines, &profiles->of_view, processes);
  const bool are_along_axis = profiles->lines == lines_along_axis(plan);
  std::vector<double> values;
  for (const PlannedView& planned : plan.views) {
    const RawFromAligned& transform = planned.raw_from_aligned;
    const double shift_px =
        profiles->lines == Lines::kColumns ? transform.shift_x_px : transform.shift_y_px;
    values.push_back(are_along_axis ? std::fabs(planned.view.tilt_deg) : shift_px);
  }
  const std::vector<int> groups = groups_by(values);
  if (!are_along_axis && !are_apart(values, groups)) return {};
  // Lines along the tilt axis that are near it see the same specimen in all views.
  const auto num_lines = static_cast<int>(profiles->num_lines);
  const base::Range unmoved =
      are_along_axis ? base::Range{num_lines * 3 / 8, num_lines * 5 / 8} : base::Range{};
  return find_line_patterns(std::move(profiles->of_view), groups, unmoved);
}

}  // namespace tomofield::tilt_series
