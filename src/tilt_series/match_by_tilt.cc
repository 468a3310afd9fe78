#include "tilt_series/match_by_tilt.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <set>

namespace tomofield::tilt_series {
namespace {

constexpr double kSame_deg = 0.05;  // tilts that differ by less are one that was recorded twice

using Tilts = std::span<const std::optional<double>>;

// Returns how far a tilt may be from its row: less than half of the smallest step between rows.
double tolerance_of(Tilts rows) {
  constexpr double kLargest_deg = 1.0, kShareOfStep = 0.45;
  std::vector<double> tilts;
  for (const auto& tilt : rows)
    if (tilt) tilts.push_back(*tilt);
  std::ranges::sort(tilts);
  double step = std::numeric_limits<double>::infinity();
  for (std::size_t i = 1; i < tilts.size(); ++i)
    if (tilts[i] - tilts[i - 1] > kSame_deg) step = std::min(step, tilts[i] - tilts[i - 1]);
  return std::min(kLargest_deg, kShareOfStep * step);
}

// Returns the places of the tilts that are near to one.
std::vector<std::size_t> near(double tilt_deg, Tilts tilts, double tolerance_deg) {
  std::vector<std::size_t> places;
  for (std::size_t i = 0; i < tilts.size(); ++i)
    if (tilts[i] && std::fabs(*tilts[i] - tilt_deg) <= tolerance_deg) places.push_back(i);
  return places;
}

}  // namespace

std::optional<std::vector<std::optional<std::size_t>>> match_by_tilt(Tilts sections, Tilts rows) {
  const double tolerance_deg = tolerance_of(rows);
  std::vector<std::optional<std::size_t>> matched(sections.size());
  std::set<std::size_t> taken;
  for (std::size_t i = 0; i < sections.size(); ++i) {
    if (!sections[i]) continue;
    const std::vector<std::size_t> near_rows = near(*sections[i], rows, tolerance_deg);
    // A tilt that was recorded twice is in both in the same order, or it is not clear which one.
    if (near_rows.size() > 1 &&
        near_rows.size() != near(*sections[i], sections, tolerance_deg).size())
      return std::nullopt;
    const auto row =
        std::ranges::find_if(near_rows, [&](std::size_t r) { return !taken.contains(r); });
    if (row == near_rows.end()) return std::nullopt;
    taken.insert(*row);
    matched[i] = *row;
  }
  return matched;
}

}  // namespace tomofield::tilt_series
