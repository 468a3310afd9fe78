#pragma once

#include <span>

#include "geometry/tilt_geometry.h"
#include "geometry/view_correction.h"

namespace tomofield::align {

/// Removes from the local motion of the views what a bent specimen explains as well. Its point
/// (X, Y) is seen at x = X cos θ and y = Y. A displacement of it is seen as a(X, Y) cos θ +
/// b(X, Y) sin θ in x and as c(X, Y) in y, and a, b and c are those that explain most in least
/// squares. They have 5 × 5 nodes over a field as wide as a view. Every view must have local
/// motion.
void remove_specimen_warp(const geometry::TiltGeometry& geometry,
                          std::span<geometry::ViewCorrection> corrections);

}  // namespace tomofield::align
