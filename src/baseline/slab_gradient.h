#pragma once

#include "projection/sample_grid.h"

namespace tomofield::baseline {

/// Factors of the forward differences K x of a slab's samples, one each axis:
///   factor_x (x[i + 1] − x[i]), factor_y (x[row + 1] − x[row]), factor_z (x[k + 1] − x[k]),
/// each zero past the last sample of its axis in a segment.
struct GradientFactors {
  float x = 1, y = 1, z = 1;
};

/// K x of z row k of a segment, as [x, lane] each to out_x, out_y and out_z. `samples` and
/// `above` are buffers of this slab and of the next (null after the last); lanes from num_rows
/// on are no voxels: their samples must be zero, and so are their differences.
void gradient_of_row(const projection::SampleSegment& segment, int k, int num_rows,
                     const GradientFactors& factors, const float* samples, const float* above,
                     float* out_x, float* out_y, float* out_z);

/// samples += Kᵀ p of z row k, for slab buffers p that are zero in the padding and wherever K x
/// always is. `p_y_below` is the buffer of the slab before (null before the first).
void add_gradient_adjoint_of_row(const projection::SampleSegment& segment, int k,
                                 const GradientFactors& factors, const float* p_x, const float* p_y,
                                 const float* p_z, const float* p_y_below, float* samples);

}  // namespace tomofield::baseline
