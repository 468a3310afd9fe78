#pragma once

#include <cstddef>

namespace tomofield::kernels {

/// Places the kLanes rows of a slab between vertices that lie one row apart. Each column of
/// vertices is contiguous, and lane l interpolates vertices l and l + 1 of a column.
struct Columns {
  std::ptrdiff_t count = 0;
  std::ptrdiff_t stride = 0;        ///< floats from one column to the next
  const float* fraction = nullptr;  ///< [lane], weight of the upper vertex
};

/// Interpolates all columns:
/// values[n, lane] += (1 − fraction) vertices[n stride + lane] + fraction vertices[… + 1].
/// Memory traffic a column: 17 vertices and 16 values, for two FMAs a lane.
void interpolate_columns(const Columns& columns, const float* vertices, float* values);

/// Applies the adjoint: vertices[n stride + …] += interpolationᵀ values[n, lane].
void spread_columns(const Columns& columns, const float* values, float* vertices);

}  // namespace tomofield::kernels
