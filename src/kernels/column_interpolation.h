#pragma once

#include <cstddef>

namespace tomofield::kernels {

/// The kLanes rows of a slab between vertices that lie one row apart, in columns of vertices that
/// are contiguous: lane l interpolates vertices l and l + 1 of a column.
struct Columns {
  std::ptrdiff_t count = 0;
  std::ptrdiff_t stride = 0;        ///< floats from a column to the next
  const float* fraction = nullptr;  ///< [lane], the weight of the upper vertex
};

/// values[n, lane] += (1 − fraction) vertices[n stride + lane] + fraction vertices[… + 1].
/// Traffic a column: 17 vertices and 16 values, two FMAs a lane.
void interpolate_columns(const Columns& columns, const float* vertices, float* values);

/// Its adjoint: vertices[n stride + …] += interpolationᵀ values[n, lane].
void spread_columns(const Columns& columns, const float* values, float* vertices);

}  // namespace tomofield::kernels
