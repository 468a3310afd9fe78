#include "geometry/tilt_order.h"

#include <algorithm>
#include <numeric>

namespace tomofield::geometry {

std::vector<std::size_t> order_of_tilts(std::span<const double> tilt_deg) {
  std::vector<std::size_t> order(tilt_deg.size());
  std::iota(order.begin(), order.end(), std::size_t{0});
  std::ranges::stable_sort(order, {}, [&](std::size_t view) { return tilt_deg[view]; });
  return order;
}

}  // namespace tomofield::geometry
