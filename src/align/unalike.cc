#include "align/unalike.h"

#include <algorithm>
#include <cmath>
#include <cstddef>

#include "base/statistics.h"
#include "geometry/tilt_geometry.h"

namespace tomofield::alignment {
namespace {

constexpr std::ptrdiff_t kNeighbours = 4;  // to each side, in order of tilt
// A view is unalike if its correlation is below the first part of the median of its neighbours, or
// below the second one and kDeviations standard deviations less than views usually are.
constexpr double kUnalike = 0.2, kPerhapsUnalike = 0.75, kDeviations = 8.0;

// Makes the errors of correlations equally large (Fisher 1915).
double stretched(double correlation) { return std::atanh(std::clamp(correlation, -0.999, 0.999)); }

}  // namespace

std::vector<int> unalike(std::span<const double> tilt_deg, std::span<const double> correlation) {
  const std::ptrdiff_t n = std::ssize(tilt_deg);
  const std::vector<std::size_t> by_tilt = geometry::order_of_tilts(tilt_deg);
  std::vector<double> expected(tilt_deg.size()), lacks(tilt_deg.size()), sizes;
  for (std::ptrdiff_t i = 0; i < n; ++i) {
    std::vector<double> neighbours;
    for (auto j = std::max(std::ptrdiff_t{0}, i - kNeighbours);
         j <= std::min(n - 1, i + kNeighbours); ++j)
      if (j != i) neighbours.push_back(correlation[by_tilt[static_cast<std::size_t>(j)]]);
    if (neighbours.empty()) continue;
    const std::size_t view = by_tilt[static_cast<std::size_t>(i)];
    expected[view] = base::median(neighbours);
    lacks[view] = stretched(expected[view]) - stretched(correlation[view]);
    sizes.push_back(std::abs(lacks[view]));
  }
  if (sizes.empty()) return {};
  const double deviation = base::kSigmaOfMedianDeviation * base::median(sizes);
  std::vector<int> views;
  for (std::size_t v = 0; v < tilt_deg.size(); ++v) {
    const bool is_unalike = correlation[v] < kUnalike * expected[v];
    const bool is_perhaps = correlation[v] < kPerhapsUnalike * expected[v];
    if (is_unalike || (is_perhaps && lacks[v] > kDeviations * deviation))
      views.push_back(static_cast<int>(v));
  }
  return views;
}

}  // namespace tomofield::alignment
