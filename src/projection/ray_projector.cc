#include "projection/ray_projector.h"

#include <algorithm>
#include <cmath>

#include "base/check.h"
#include "base/parallel.h"
#include "projection/leaf_vertices.h"

namespace tomofield::projection {
namespace {

using geometry::RayBundle;
using kernels::RayPiece;

constexpr std::int64_t kRaysAtOnce = 512;       // rays that a thread traces at a time
constexpr std::uint32_t kGolden = 0x9e3779b9U;  // step of random_unit's counter

std::uint32_t key_of(const Ray& ray, std::uint32_t draw) {
  std::uint32_t key = kernels::mix_bits(draw + kGolden);
  key = kernels::mix_bits(key ^ static_cast<std::uint32_t>(ray.view));
  key = kernels::mix_bits(key ^ static_cast<std::uint32_t>(ray.y));
  return kernels::mix_bits(key ^ static_cast<std::uint32_t>(ray.x));
}

float* scratch(std::size_t size) {
  thread_local base::AlignedBuffer<float> buffer;
  buffer.reserve(size);
  return buffer.data();
}

}  // namespace

RayProjector::RayProjector(const geometry::RayGeometry& geometry, const field::Field& field,
                           const geometry::Extent2& support, int samples_per_diagonal)
    : field_(field), support_(support), samples_per_diagonal_(samples_per_diagonal) {
  TOMOFIELD_CHECK(samples_per_diagonal > 0, "rays need samples");
  for (int view = 0; view < geometry.num_views(); ++view) bundles_.push_back(geometry.rays(view));
}

// Returns the samples of a crossing without the key.
RayPiece RayProjector::sample_positions(const RayBundle& bundle, const RayBundle::Line& line,
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
  base::parallel_for(static_cast<std::int64_t>(blocks.size()), [&](std::int64_t block) {
    std::vector<LeafCrossing> crossings;
    const std::int64_t end = std::min(num_rays, (block + 1) * kRaysAtOnce);
    for (std::int64_t i = block * kRaysAtOnce; i < end; ++i) {
      const Ray& ray = rays[static_cast<std::size_t>(i)];
      const RayBundle& bundle = bundles_[static_cast<std::size_t>(ray.view)];
      const RayBundle::Line line = bundle.line(ray.x + 0.5, ray.y + 0.5);
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
  base::parallel_for(field_.tree().num_leaves(), [&](std::int64_t l) {
    const int leaf = static_cast<int>(l);
    const std::size_t first = trace.first_of_leaf_[static_cast<std::size_t>(leaf)];
    const std::size_t end = trace.first_of_leaf_[static_cast<std::size_t>(leaf) + 1];
    if (first == end) return;
    const kernels::LeafVertices vertices = vertices_of(field_.shape(leaf));
    float* values = scratch(vertices.size());
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
  base::parallel_for(num_leaves, [&](std::int64_t l) {
    const int leaf = static_cast<int>(l);
    const std::size_t first = trace.first_of_leaf_[static_cast<std::size_t>(leaf)];
    const std::size_t end = trace.first_of_leaf_[static_cast<std::size_t>(leaf) + 1];
    if (first == end) return;
    const kernels::LeafVertices vertices = vertices_of(field_.shape(leaf));
    float* grad_values = scratch(vertices.size());
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
