#include "tilt_series/match_by_tilt.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <set>

namespace tomofield::tilt_series {
namespace {

using Tilts = std::span<const std::optional<double>>;

// Returns how far a tilt may be from its row: less than half of the smallest step between rows.
double tolerance_of(Tilts rows) {
  constexpr double kLargest_deg = 1.0, kShareOfStep = 0.45;
  std::vector<double> tilts;
  for (const auto& tilt : rows)
    if (tilt) tilts.push_back(*tilt);
  std::ranges::sort(tilts);
  double step = std::numeric_limits<double>::infinity();
  for (std::size_t i = 1; i < tilts.size(); ++i) step = std::min(step, tilts[i] - tilts[i - 1]);
  return std::min(kLargest_deg, kShareOfStep * step);
}

}  // namespace

std::optional<std::vector<std::optional<std::size_t>>> match_by_tilt(Tilts sections, Tilts rows) {
  const double tolerance_deg = tolerance_of(rows);
  std::vector<std::optional<std::size_t>> matched(sections.size());
  std::set<std::size_t> taken;
  for (std::size_t i = 0; i < sections.size(); ++i) {
    if (!sections[i]) continue;
    for (std::size_t row = 0; row < rows.size() && !matched[i]; ++row)
      if (rows[row] && std::fabs(*rows[row] - *sections[i]) <= tolerance_deg) matched[i] = row;
    if (!matched[i] || !taken.insert(*matched[i]).second) return std::nullopt;
  }
  return matched;
}

}  // namespace tomofield::tilt_series
