#pragma once

#include <vector>

#include "field/tree/quadtree.h"
#include "geometry/ray_geometry.h"

namespace tomofield::projection {

/// The piece of a ray inside one leaf.
struct LeafCrossing {
  int leaf = 0;
  geometry::HeightRange heights;  ///< never empty
};

/// Appends the leaves that a line crosses within `heights`, in the order of the leaves. Leaves are
/// vertical prisms, so only (X, Y) matters. Each point of the line over the tree belongs to exactly
/// one crossing.
void find_crossings(const field::Quadtree& tree, const geometry::RayBundle::Line& line,
                    const geometry::HeightRange& heights, std::vector<LeafCrossing>& crossings);

}  // namespace tomofield::projection
