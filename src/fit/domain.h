#pragma once

#include <memory>
#include <vector>

#include "field/field.h"
#include "fit/constants.h"
#include "geometry/ray_geometry.h"
#include "geometry/tilt_geometry.h"
#include "projection/sample_grid.h"
#include "tomofield/options.h"

namespace tomofield::fit {

/// Describes the volume that a field covers: its tree of leaves, the vertices of each leaf, and the
/// grid on which projections sample it.
///
/// The tree covers the region of interest and, if FieldOptions::with_margin, everything around it
/// that a ray through the region crosses. Lengths are pixels of the binned view. Positions x and y
/// are pixels of an aligned view; z runs from 0 to the thickness.
struct Domain {
  Rectangle roi;                             ///< region of interest
  geometry::Extent2 support;                 ///< densities outside this rectangle count as 0
  std::int64_t first_row = 0, num_rows = 0;  ///< rows (y) that the slabs cover
  projection::SampleGrid grid;               ///< samples of a slab at full resolution
  field::Quadtree tree;                      ///< the leaves that a fit starts with
  std::vector<field::LeafShape> shapes;      ///< vertices of each leaf of `tree`
  double spacing = 1.0;         ///< between vertices of the smallest leaves in the region
  double margin_spacing = 1.0;  ///< between vertices of the margin

  /// Returns how many times farther apart vertices are in a stage whose pixels are `bin` times as
  /// wide than at full resolution. The factor is `bin` for vertices that are no farther apart than
  /// by default (FieldOptions). Vertices that are farther apart stay where they are until they
  /// would be closer, in pixels of the stage, than by default. The factor also holds for the
  /// samples of the margin.
  double coarsening(field::Region region, int bin) const;

  /// Returns the vertices of a leaf in a stage whose pixels are `bin` times as wide. All leaves of
  /// a region have the same number of them, also after the tree has changed. The tree must have a
  /// leaf in `region`.
  field::LeafShape shape_in(field::Region region, int bin) const;
  /// Returns the vertices of all leaves of a tree in a stage.
  std::vector<field::LeafShape> shapes_in(const field::Quadtree& of_tree, int bin) const;
};

/// Returns the number of rows of a band, which is the side of a root cell.
std::int64_t band_rows(const FieldOptions& options);

/// Makes the domain of a fit to aligned views, with the slab engine. Rays stay in their row, so the
/// domain ends with the region of interest along y.
Domain make_domain(const geometry::TiltGeometry& geometry, const Rectangle& roi,
                   const FieldOptions& options);

/// Makes the domain of a fit to views as they were recorded, with the ray engine. Their rays may
/// cross rows, so a margin also extends along y.
Domain make_domain(const geometry::RayGeometry& geometry, const Rectangle& roi,
                   const FieldOptions& options);

/// Returns the sample grid of a stage whose pixels are `bin` times as wide, in its coordinates. It
/// has one sample a pixel of the stage in the region of interest. It covers what Domain::grid
/// covers, but its margins may end up to one sample earlier. `thickness` is in pixels at full
/// resolution.
projection::SampleGrid sample_grid(const Domain& domain, double thickness, int bin);

/// Returns the bias whose activation is `density`: the inverse of softplus with sharpness `beta`,
/// or of the identity if `beta` is 0. Softplus reaches no density of 0 or less, so the bias of a
/// small positive density is returned for those.
double bias_of_density(double density, double beta);

/// Makes the field that a fit starts from, with a density of about `mean_density` everywhere and
/// random factors from `seed`. The process keeps the leaves in `kept` alone (Field::keep_only); an
/// empty list keeps all. `thickness` is in pixels.
std::unique_ptr<field::Field> make_initial_field(const Domain& domain, double thickness,
                                                 double mean_density, const FieldOptions& options,
                                                 std::uint64_t seed,
                                                 const std::vector<int>& kept = {},
                                                 const FieldStart& start = {});

}  // namespace tomofield::fit
