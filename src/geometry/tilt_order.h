#pragma once

#include <cstddef>
#include <span>
#include <vector>

namespace tomofield::geometry {

/// Returns the numbers of the views in order of tilt. Views of one tilt keep their order.
std::vector<std::size_t> order_of_tilts(std::span<const double> tilt_deg);

}  // namespace tomofield::geometry
