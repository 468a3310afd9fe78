#include "projection/ray_projector.h"

#include <algorithm>
#include <cmath>

#include "base/aligned_buffer.h"
#include "base/check.h"
#include "base/range.h"
#include "base/threads/parallel.h"
#include "kernels/lanes.h"

namespace tomofield::projection {
namespace {

using geometry::HeightRange;
using geometry::RayBundle;
using kernels::kLanes;
using kernels::RayPiece;
using Line = RayBundle::Line;

constexpr std::int64_t kRaysAtOnce = 512;       // rays that a thread traces at a time
constexpr std::uint32_t kGolden = 0x9e3779b9U;  // step of random_unit's counter

std::uint32_t key_of(const Ray& ray, std::uint32_t draw) {
  std::uint32_t key = kernels::mix_bits(draw + kGolden);
  key = kernels::mix_bits(key ^ static_cast<std::uint32_t>(ray.view));
  key = kernels::mix_bits(key ^ static_cast<std::uint32_t>(ray.y));
  return kernels::mix_bits(key ^ static_cast<std::uint32_t>(ray.x));
}

// Returns the memory of this thread for the vertex values of a leaf.
float* leaf_scratch(std::size_t size) {
  thread_local base::AlignedBuffer<float> buffer;
  buffer.reserve(size);
  return buffer.data();
}

// Returns the memory of this thread for 16 rows of a leaf.
float* slab_scratch(std::size_t size) {
  thread_local base::AlignedBuffer<float> buffer;
  buffer.reserve(size);
  return buffer.data();
}

// Returns a leaf's vertex counts as the ray kernels take them.
kernels::LeafVertices vertices_of(const field::LeafShape& shape) {
  return {.nx = shape.nx, .nz = shape.nz, .ny = shape.ny};
}

// Returns 16 rows of vertices, from row `first` on, as the rows of a slab. Rows past the last
// vertex repeat it.
field::LaneRows vertex_rows(int first, int ny) {
  field::LaneRows rows;
  for (int l = 0; l < kLanes; ++l) {
    const int vertex = std::min(first + l, ny - 1);
    const int lower = std::min(vertex, ny - 2);
    rows.lower[static_cast<std::size_t>(l)] = lower;
    rows.fraction[static_cast<std::size_t>(l)] = static_cast<float>(vertex - lower);
  }
  return rows;
}

// Overwrites values[x, z, y] with the pre-activation at every vertex of a leaf, bias included. Its
// trilinear interpolation is the leaf's pre-activation everywhere.
void contract_leaf(const field::Field& field, int leaf, float* values) {
  const field::LeafShape& shape = field.shape(leaf);
  const std::size_t columns = shape.vertices_xz();
  float* slab = slab_scratch(columns * kLanes);
  for (int first = 0; first < shape.ny; first += kLanes) {
    const int count = std::min(kLanes, shape.ny - first);
    field.slab_values(leaf, vertex_rows(first, shape.ny), slab);
    for (std::size_t c = 0; c < columns; ++c)
      std::copy_n(slab + c * kLanes, count,
                  values + c * static_cast<std::size_t>(shape.ny) + first);
  }
}

// Applies the adjoint: adds dL/d parameters of the leaf to gradient[0 … count).
void contract_leaf_adjoint(const field::Field& field, int leaf, const float* grad_values,
                           float* gradient) {
  const field::LeafShape& shape = field.shape(leaf);
  const std::size_t columns = shape.vertices_xz();
  float* slab = slab_scratch(columns * kLanes);
  for (int first = 0; first < shape.ny; first += kLanes) {
    const int count = std::min(kLanes, shape.ny - first);
    std::fill_n(slab, columns * kLanes, 0.0f);
    for (std::size_t c = 0; c < columns; ++c) {
      std::copy_n(grad_values + c * static_cast<std::size_t>(shape.ny) + first, count,
                  slab + c * kLanes);
    }
    field.slab_gradient(leaf, vertex_rows(first, shape.ny), slab, gradient);
  }
}

// Appends the leaves below a node that a line crosses.
void descend(const field::Quadtree& tree, int index, const Line& line, const HeightRange& heights,
             std::vector<LeafCrossing>& crossings) {
  const field::QuadtreeNode& node = tree.nodes()[static_cast<std::size_t>(index)];
  const field::Quadtree::Bounds b = tree.bounds(node.square);
  const HeightRange inside = clip(line, {b.x0, b.y0, b.x1, b.y1}, heights);
  if (inside.empty()) return;
  if (node.is_leaf()) {
    crossings.push_back({tree.leaf_of_node(index), inside});
    return;
  }
  for (int c = 0; c < 4; ++c) descend(tree, node.first_child + c, line, heights, crossings);
}

// Returns the root cells along one axis that positions between a and b touch.
base::Range cells_between(double a, double b, std::int64_t origin, std::int64_t size, int count) {
  const auto cell = [&](double position) {
    const double at =
        std::floor((position - static_cast<double>(origin)) / static_cast<double>(size));
    return static_cast<int>(std::clamp(at, -1.0, static_cast<double>(count)));
  };
  // One cell more on either side protects against rounding; clip() decides.
  return {std::max(cell(std::min(a, b)) - 1, 0), std::min(cell(std::max(a, b)) + 2, count)};
}

}  // namespace

void find_crossings(const field::Quadtree& tree, const Line& line, const HeightRange& heights,
                    std::vector<LeafCrossing>& crossings) {
  if (heights.empty()) return;
  const field::RootGrid& roots = tree.roots();
  const auto along_x = [&](double z) { return line.x0 + line.x_per_z * z; };
  const auto along_y = [&](double z) { return line.y0 + line.y_per_z * z; };
  const base::Range columns = cells_between(along_x(heights.low), along_x(heights.high), roots.x0,
                                            roots.cell_size, roots.columns);
  const base::Range rows = cells_between(along_y(heights.low), along_y(heights.high), roots.y0,
                                         roots.cell_size, roots.rows);
  for (int row = rows.begin; row < rows.end; ++row) {
    for (int column = columns.begin; column < columns.end; ++column)
      descend(tree, row * roots.columns + column, line, heights, crossings);
  }
}

RayProjector::RayProjector(const geometry::RayGeometry& geometry, const field::Field& field,
                           const geometry::Extent2& support, int samples_per_diagonal)
    : field_(field), support_(support), samples_per_diagonal_(samples_per_diagonal) {
  TOMOFIELD_CHECK(samples_per_diagonal > 0, "rays need samples");
  for (int view = 0; view < geometry.num_views(); ++view) bundles_.push_back(geometry.rays(view));
}

// Returns the samples of a crossing without the key.
RayPiece RayProjector::sample_positions(const RayBundle& bundle, const Line& line,
                                        const LeafCrossing& crossing) const {
  const field::Square& square = field_.tree().leaf(crossing.leaf).square;
  const field::LeafShape& shape = field_.shape(crossing.leaf);
  const double size = static_cast<double>(square.size);
  const double height = crossing.heights.high - crossing.heights.low;
  const double length = height * bundle.length_per_z;
  const double diagonal = std::hypot(size, size, field_.thickness());
  const double per_x = (shape.nx - 1) / size, per_y = (shape.ny - 1) / size;
  const double per_z = (shape.nz - 1) / field::vertex_height(field_.thickness());
  const double low = crossing.heights.low;

  RayPiece piece;
  piece.num_samples =
      std::max(1, static_cast<int>(std::ceil(samples_per_diagonal_ * length / diagonal)));
  piece.segment_length = static_cast<float>(length / piece.num_samples);
  piece.start_x = static_cast<float>(field_.vertex_x(crossing.leaf, line.x0 + line.x_per_z * low));
  piece.start_y = static_cast<float>(field_.vertex_y(crossing.leaf, line.y0 + line.y_per_z * low));
  piece.start_z = static_cast<float>(field_.vertex_z(crossing.leaf, low));
  piece.span_x = static_cast<float>(line.x_per_z * height * per_x);
  piece.span_y = static_cast<float>(line.y_per_z * height * per_y);
  piece.span_z = static_cast<float>(height * per_z);
  return piece;
}

void RayProjector::trace_rays(std::span<const Ray> rays, std::uint32_t draw,
                              RayTrace& trace) const {
  struct Found {
    int leaf;
    RayTrace::Piece piece;
  };
  const auto num_rays = static_cast<std::int64_t>(rays.size());
  std::vector<std::vector<Found>> blocks(
      static_cast<std::size_t>((num_rays + kRaysAtOnce - 1) / kRaysAtOnce));
  base::parallel_for(
      "trace rays", static_cast<std::int64_t>(blocks.size()), [&](std::int64_t block) {
        std::vector<LeafCrossing> crossings;
        const std::int64_t end = std::min(num_rays, (block + 1) * kRaysAtOnce);
        for (std::int64_t i = block * kRaysAtOnce; i < end; ++i) {
          const Ray& ray = rays[static_cast<std::size_t>(i)];
          const RayBundle& bundle = bundles_[static_cast<std::size_t>(ray.view)];
          const Line line = bundle.line(ray.x + 0.5, ray.y + 0.5);
          crossings.clear();
          find_crossings(field_.tree(), line, clip(line, support_, {0.0, field_.thickness()}),
                         crossings);
          std::uint32_t key = key_of(ray, draw);
          for (const LeafCrossing& crossing : crossings) {
            Found found{.leaf = crossing.leaf, .piece = {}};
            found.piece.samples = sample_positions(bundle, line, crossing);
            found.piece.samples.key = key;
            found.piece.ray = static_cast<std::uint32_t>(i);
            key += kGolden * static_cast<std::uint32_t>(found.piece.samples.num_samples);
            blocks[static_cast<std::size_t>(block)].push_back(found);
          }
        }
      });

  // Sort the pieces by leaf; each leaf's pieces stay in the order of the rays.
  trace.first_of_leaf_.assign(static_cast<std::size_t>(field_.tree().num_leaves()) + 1, 0);
  for (const auto& block : blocks) {
    for (const Found& found : block)
      ++trace.first_of_leaf_[static_cast<std::size_t>(found.leaf) + 1];
  }
  for (std::size_t l = 1; l < trace.first_of_leaf_.size(); ++l)
    trace.first_of_leaf_[l] += trace.first_of_leaf_[l - 1];
  trace.pieces_.resize(trace.first_of_leaf_.back());
  std::vector<std::size_t> next(trace.first_of_leaf_.begin(), trace.first_of_leaf_.end() - 1);
  for (const auto& block : blocks) {
    for (const Found& found : block)
      trace.pieces_[next[static_cast<std::size_t>(found.leaf)]++] = found.piece;
  }
  std::size_t num_densities = 0;
  for (RayTrace::Piece& piece : trace.pieces_) {
    piece.first_density = num_densities;
    num_densities += kernels::padded_samples(piece.samples.num_samples);
  }
  trace.densities_.reserve(num_densities);
}

std::vector<float> RayProjector::forward(std::span<const Ray> rays, std::uint32_t draw,
                                         RayTrace& trace) const {
  trace_rays(rays, draw, trace);
  base::parallel_for("sample leaves", field_.tree().num_leaves(), [&](std::int64_t l) {
    const int leaf = static_cast<int>(l);
    const std::size_t first = trace.first_of_leaf_[static_cast<std::size_t>(leaf)];
    const std::size_t end = trace.first_of_leaf_[static_cast<std::size_t>(leaf) + 1];
    if (first == end) return;
    const kernels::LeafVertices vertices = vertices_of(field_.shape(leaf));
    float* values = leaf_scratch(vertices.size());
    contract_leaf(field_, leaf, values);
    for (std::size_t p = first; p < end; ++p) {
      RayTrace::Piece& piece = trace.pieces_[p];
      piece.sum = kernels::integrate_piece(vertices, field_.activation, values, piece.samples,
                                           trace.densities_.data() + piece.first_density);
    }
  });
  std::vector<double> sums(rays.size(), 0.0);
  for (const RayTrace::Piece& piece : trace.pieces_) sums[piece.ray] += piece.sum;
  return {sums.begin(), sums.end()};
}

double RayProjector::backward(const RayTrace& trace, std::span<const float> grad_rays,
                              float* gradient) const {
  const int num_leaves = field_.tree().num_leaves();
  std::vector<double> grad_bias(static_cast<std::size_t>(num_leaves), 0.0);
  base::parallel_for("gradient of leaves", num_leaves, [&](std::int64_t l) {
    const int leaf = static_cast<int>(l);
    const std::size_t first = trace.first_of_leaf_[static_cast<std::size_t>(leaf)];
    const std::size_t end = trace.first_of_leaf_[static_cast<std::size_t>(leaf) + 1];
    if (first == end) return;
    const kernels::LeafVertices vertices = vertices_of(field_.shape(leaf));
    float* grad_values = leaf_scratch(vertices.size());
    std::fill_n(grad_values, vertices.size(), 0.0f);
    for (std::size_t p = first; p < end; ++p) {
      const RayTrace::Piece& piece = trace.pieces_[p];
      grad_bias[static_cast<std::size_t>(leaf)] += kernels::spread_piece(
          vertices, field_.activation, piece.samples, trace.densities_.data() + piece.first_density,
          grad_rays[piece.ray], grad_values);
    }
    contract_leaf_adjoint(field_, leaf, grad_values, gradient + field_.offset(leaf));
  });
  double sum = 0.0;
  for (const double part : grad_bias) sum += part;
  return sum;
}

}  // namespace tomofield::projection
