#include "projection/leaf_vertices.h"

#include <algorithm>

#include "base/aligned_buffer.h"
#include "kernels/lanes.h"

namespace tomofield::projection {
namespace {

using kernels::kLanes;

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

float* scratch(std::size_t size) {
  thread_local base::AlignedBuffer<float> buffer;
  buffer.reserve(size);
  return buffer.data();
}

}  // namespace

kernels::LeafVertices vertices_of(const field::LeafShape& shape) {
  return {.nx = shape.nx, .nz = shape.nz, .ny = shape.ny};
}

void contract_leaf(const field::Field& field, int leaf, float* values) {
  const field::LeafShape& shape = field.shape(leaf);
  const std::size_t columns = shape.vertices_xz();
  float* slab = scratch(columns * kLanes);
  for (int first = 0; first < shape.ny; first += kLanes) {
    const int count = std::min(kLanes, shape.ny - first);
    field.slab_values(leaf, vertex_rows(first, shape.ny), slab);
    for (std::size_t c = 0; c < columns; ++c)
      std::copy_n(slab + c * kLanes, count,
                  values + c * static_cast<std::size_t>(shape.ny) + first);
  }
}

void contract_leaf_adjoint(const field::Field& field, int leaf, const float* grad_values,
                           float* gradient) {
  const field::LeafShape& shape = field.shape(leaf);
  const std::size_t columns = shape.vertices_xz();
  float* slab = scratch(columns * kLanes);
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

}  // namespace tomofield::projection
