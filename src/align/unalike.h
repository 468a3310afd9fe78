#pragma once

#include <span>
#include <vector>

namespace tomofield::alignment {

/// Returns the views, ascending, that resemble their projections much less than the views of nearly
/// the same tilt do: they show something else, or their alignment is wrong. `correlation` is that
/// of each view with its projection.
std::vector<int> unalike(std::span<const double> tilt_deg, std::span<const double> correlation);

}  // namespace tomofield::alignment
