#pragma once

#include "base/range.h"
#include "field/tree/quadtree.h"

namespace tomofield::field {

/// Returns a tree of some bands of another one. Its leaves are those of the bands, in the same
/// order.
Quadtree some_bands(const Quadtree& tree, base::Range bands);

/// Says whether two trees have the same columns, and `upper` begins where `lower` ends.
bool is_joinable(const Quadtree& lower, const Quadtree& upper);

/// Returns a tree of the bands of both trees. Those of `upper` follow those of `lower`, and so do
/// its leaves. They must be joinable.
Quadtree joined(const Quadtree& lower, const Quadtree& upper);

/// Returns the leaves of some bands; their numbers are consecutive.
base::Range leaves_of_bands(const Quadtree& tree, base::Range bands);

}  // namespace tomofield::field
