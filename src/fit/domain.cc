#include "fit/domain.h"

#include <algorithm>
#include <cmath>

#include "base/random.h"

namespace tomofield::fit {
namespace {

field::LeafShape leaf_shape(double size, double thickness, double spacing, double spacing_z,
                            int rank) {
  const auto vertices = [](double length, double step) {
    return std::max(2, static_cast<int>(std::lround(length / step)) + 1);
  };
  const int n = vertices(size, spacing);
  return {.nx = n,
          .ny = n,
          .nz = vertices(field::vertex_height(thickness), spacing_z),
          .rank_x = rank,
          .rank_y = rank,
          .rank_z = rank};
}

// Returns the root cells that cover `reach`. The region of interest starts on the corner of a cell.
field::RootGrid root_grid(const Rectangle& roi, const geometry::Extent2& reach, std::int64_t cell) {
  const auto cells = [cell](double length) {
    return static_cast<std::int64_t>(std::ceil(length / static_cast<double>(cell)));
  };
  const std::int64_t left = cells(static_cast<double>(roi.x0) - reach.x0);
  const std::int64_t below = cells(static_cast<double>(roi.y0) - reach.y0);
  field::RootGrid grid;
  grid.cell_size = cell;
  grid.x0 = roi.x0 - left * cell;
  grid.y0 = roi.y0 - below * cell;
  grid.columns = static_cast<int>(left + cells(reach.x1 - static_cast<double>(roi.x0)));
  grid.rows = static_cast<int>(below + cells(reach.y1 - static_cast<double>(roi.y0)));
  return grid;
}

// Makes the tree that a fit starts with: the cells of the region of interest are split.
field::Quadtree make_tree(const field::RootGrid& roots, const Rectangle& roi, int depth) {
  std::vector<field::Region> regions;
  for (int row = 0; row < roots.rows; ++row) {
    for (int column = 0; column < roots.columns; ++column) {
      const std::int64_t x0 = roots.x0 + column * roots.cell_size;
      const std::int64_t y0 = roots.y0 + row * roots.cell_size;
      const bool inside = x0 < roi.x1 && x0 + roots.cell_size > roi.x0 && y0 < roi.y1 &&
                          y0 + roots.cell_size > roi.y0;
      regions.push_back(inside ? field::Region::kInterest : field::Region::kMargin);
    }
  }
  field::Quadtree tree(roots, regions);
  tree.split_to_level(field::Region::kInterest, depth);
  return tree;
}

// Returns the vertices of the leaves of a tree.
std::vector<field::LeafShape> leaf_shapes(const field::Quadtree& tree, double thickness,
                                          const FieldOptions& options) {
  std::vector<field::LeafShape> shapes;
  for (int leaf = 0; leaf < tree.num_leaves(); ++leaf) {
    const bool inside = tree.leaf(leaf).region == field::Region::kInterest;
    // Along z all leaves are as fine as the finest ones are in the plane.
    shapes.push_back(leaf_shape(static_cast<double>(tree.leaf(leaf).square.size), thickness,
                                inside ? options.vertex_spacing : options.margin_spacing,
                                inside ? options.finest_spacing() : options.margin_spacing,
                                inside ? *options.rank : kMarginRank));
  }
  return shapes;
}

// Makes a domain for rays that meet the region of interest and reach no further than `reach`.
Domain cover(double thickness, const Rectangle& roi, geometry::Extent2 reach,
             const FieldOptions& options) {
  projection::SampleGrid grid = projection::make_sample_grid(
      {reach.x0, reach.x1}, thickness, static_cast<double>(roi.x0), static_cast<double>(roi.x1),
      options.with_margin ? options.margin_spacing : 0.0);
  if (!options.with_margin) {
    reach = {static_cast<double>(roi.x0), static_cast<double>(roi.y0), static_cast<double>(roi.x1),
             static_cast<double>(roi.y1)};
  }
  for (const projection::SampleSegment& s : grid.segments()) {
    reach.x0 = std::min(reach.x0, s.x0);
    reach.x1 = std::max(reach.x1, s.x1());
  }
  const field::RootGrid roots = root_grid(roi, reach, band_rows(options));
  // The first slab starts with the first row of cells.
  const auto end_row = static_cast<std::int64_t>(std::ceil(reach.y1));
  reach.y0 = static_cast<double>(roots.y0);
  reach.y1 = static_cast<double>(end_row);
  field::Quadtree tree = make_tree(roots, roi, depth_of(options));
  std::vector<field::LeafShape> shapes = leaf_shapes(tree, thickness, options);
  return {.roi = roi,
          .support = reach,
          .first_row = roots.y0,
          .num_rows = end_row - roots.y0,
          .grid = std::move(grid),
          .tree = std::move(tree),
          .shapes = std::move(shapes),
          .spacing = options.finest_spacing(),
          .margin_spacing = options.margin_spacing};
}

}  // namespace

std::int64_t band_rows(const FieldOptions& options) {
  return static_cast<std::int64_t>(*options.leaf_size) << depth_of(options);
}

Domain make_domain(const geometry::TiltGeometry& geometry, const Rectangle& roi,
                   const FieldOptions& options) {
  const auto reach = geometry.reach();
  return cover(geometry.thickness, roi,
               {reach.low, static_cast<double>(roi.y0), reach.high, static_cast<double>(roi.y1)},
               options);
}

Domain make_domain(const geometry::RayGeometry& geometry, const Rectangle& roi,
                   const FieldOptions& options) {
  return cover(geometry.aligned.thickness, roi, reach_of_rays(geometry, roi), options);
}

double Domain::coarsening(field::Region region, int bin) const {
  const FieldOptions usual;
  const double usual_over_own = region == field::Region::kInterest
                                    ? usual.vertex_spacing / spacing
                                    : usual.margin_spacing / margin_spacing;
  return std::max(1.0, bin * std::min(1.0, usual_over_own));
}

std::vector<field::LeafShape> Domain::shapes_in(const field::Quadtree& of_tree, int bin) const {
  std::vector<field::LeafShape> all;
  for (int leaf = 0; leaf < of_tree.num_leaves(); ++leaf)
    all.push_back(shape_in(of_tree.leaf(leaf).region, bin));
  return all;
}

field::LeafShape Domain::shape_in(field::Region region, int bin) const {
  int leaf = 0;
  while (tree.leaf(leaf).region != region) ++leaf;
  field::LeafShape shape = shapes[static_cast<std::size_t>(leaf)];
  const double ratio = coarsening(region, bin);
  for (int* n : {&shape.nx, &shape.ny, &shape.nz})
    *n = std::max(2, static_cast<int>(std::lround((*n - 1) / ratio)) + 1);
  return shape;
}

projection::SampleGrid sample_grid(const Domain& domain, double thickness, int bin) {
  if (bin == 1) return domain.grid;
  const auto& fine = domain.grid.segments();
  const double x0 = fine.front().x0 / bin;
  const double x1 = x0 + (fine.front().nx + bin - 1) / bin;
  if (fine.size() == 1) return projection::make_sample_grid({x0, x1}, thickness / bin, x0, x1, 0);
  const double spacing = fine.back().hx * domain.coarsening(field::Region::kMargin, bin) / bin;
  // The grid rounds the number of samples up. Half a sample less leaves those inside the field.
  const auto length = [spacing](double reach) {
    return (std::floor(reach / spacing) - 0.5) * spacing;
  };
  return projection::make_sample_grid(
      {x0 - length(x0 - domain.support.x0 / bin), x1 + length(domain.support.x1 / bin - x1)},
      thickness / bin, x0, x1, spacing);
}

double bias_of_density(double density, double beta) {
  if (beta <= 0) return density;
  const double positive = std::max(density, 1e-3);
  return std::log(std::expm1(beta * positive)) / beta;
}

std::unique_ptr<field::Field> make_initial_field(const Domain& domain, double thickness,
                                                 double mean_density, const FieldOptions& options,
                                                 std::uint64_t seed, const std::vector<int>& kept,
                                                 const FieldStart& start) {
  auto field = field::make_field(options.kind, domain.tree, thickness, domain.shapes);
  const double beta = options.activation == Activation::kSoftplus ? start.sharpness : 0.0;
  field->activation.beta = static_cast<float>(beta);
  field->bias = static_cast<float>(bias_of_density(mean_density, beta));
  field->keep_only(kept);
  field->initialise(base::Random(seed), start.initial_scale);
  return field;
}

}  // namespace tomofield::fit
