#pragma once

#include <memory>

#include "field/field.h"
#include "geometry/tilt_geometry.h"
#include "projection/sample_grid.h"
#include "reconstruct/options.h"

namespace tomofield::reconstruct {

/// Where the field lives and how it is sampled: root cells over the region of
/// interest and, with a margin, as far in x as any ray reaches.
struct Domain {
  geometry::Roi roi;
  projection::SampleGrid grid;
  field::Quadtree tree;
  std::vector<field::LeafShape> shapes;
};

Domain make_domain(const geometry::TiltGeometry& geometry, const geometry::Roi& roi,
                   const FieldOptions& options);

/// A new field on the domain whose density is about `mean_density` everywhere.
std::unique_ptr<field::Field> make_initial_field(const Domain& domain, double thickness,
                                                 double mean_density, const FieldOptions& options,
                                                 std::uint64_t seed);

}  // namespace tomofield::reconstruct
