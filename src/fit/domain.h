#pragma once

#include <memory>
#include <vector>

#include "field/field.h"
#include "fit/options.h"
#include "geometry/ray_geometry.h"
#include "geometry/tilt_geometry.h"
#include "projection/sample_grid.h"
#include "tomofield/options.h"

namespace tomofield::fit {

/// Where the field lives and how it is sampled: root cells over the region of
/// interest and, with a margin, as far as any ray reaches.
struct Domain {
  Rectangle roi;
  geometry::Extent2 support;  ///< where densities count: what `grid` and the rows cover
  std::int64_t first_row = 0, num_rows = 0;  ///< of the slabs
  projection::SampleGrid grid;
  field::Quadtree tree;
  std::vector<field::LeafShape> shapes;
  double spacing = 1.0, margin_spacing = 1.0;  ///< of the smallest leaves' vertices, in pixels

  /// How many times as far apart as at full resolution vertices (and a margin's samples) are in a
  /// stage of pixels `bin` times as wide: once, but no closer in the stage's pixels than usual.
  double coarsening(field::Region region, int bin) const;
  /// Of the leaves in a region, whatever becomes of the tree, which has some, in such a stage: to
  /// the next whole number of vertices.
  field::LeafShape shape_in(field::Region region, int bin) const;
};

/// Rows of a band, which are those of a root cell.
std::int64_t band_rows(const FieldOptions& options);

Domain make_domain(const geometry::TiltGeometry& geometry, const Rectangle& roi,
                   const FieldOptions& options);

/// For views as they were recorded, whose rays also leave the region across its rows.
Domain make_domain(const geometry::RayGeometry& geometry, const Rectangle& roi,
                   const FieldOptions& options);

/// What `grid` covers at one sample a pixel of a stage, in its coordinates; margins end
/// up to a sample earlier.
projection::SampleGrid sample_grid(const Domain& domain, double thickness, int bin);

/// The bias whose activation is `density`, by the inverse of softplus of sharpness β (0: the
/// identity). A density of zero or less has none, so a small one stands in.
double bias_of_density(double density, double beta);

/// A new field on the domain whose density is about `mean_density` everywhere. `kept`: the
/// leaves that are asked for here (Field::keep_only); none: all.
std::unique_ptr<field::Field> make_initial_field(const Domain& domain, double thickness,
                                                 double mean_density, const FieldOptions& options,
                                                 std::uint64_t seed,
                                                 const std::vector<int>& kept = {});

}  // namespace tomofield::fit
