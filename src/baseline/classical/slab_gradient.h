#pragma once

#include <cstddef>
#include <vector>

#include "baseline/voxel_volume.h"
#include "kernels/lanes.h"
#include "projection/sample_grid.h"

namespace tomofield::baseline {

/// The factors of the forward differences K x of a slab's samples, one an axis:
///   factor_x (x[i + 1] − x[i]), factor_y (x[row + 1] − x[row]), factor_z (x[k + 1] − x[k]).
/// Each difference is zero past the last sample of its axis in a segment.
struct GradientFactors {
  float x = 1, y = 1, z = 1;
};

/// Computes K x of z row k of a segment and writes it to out_x, out_y and out_z, each [x, lane].
/// `samples` and `above` are buffers of this slab and of the next (null after the last). Lanes from
/// num_rows on are no voxels: their samples must be zero, and so are their differences.
void gradient_of_row(const projection::SampleSegment& segment, int k, int num_rows,
                     const GradientFactors& factors, const float* samples, const float* above,
                     float* out_x, float* out_y, float* out_z);

/// Adds Kᵀ p of z row k to `samples`. The slab buffers p must be zero in the padding and wherever K
/// x is zero by definition. `p_y_below` is the buffer of the slab before (null before the first).
void add_gradient_adjoint_of_row(const projection::SampleSegment& segment, int k,
                                 const GradientFactors& factors, const float* p_x, const float* p_y,
                                 const float* p_z, const float* p_y_below, float* samples);

/// The K x of one z row of a slab: `count` values each, for the samples from `row` on in a slab
/// buffer.
struct GradientRow {
  GradientFactors factors;
  std::ptrdiff_t row = 0;
  std::size_t count = 0;
  const float *x = nullptr, *y = nullptr, *z = nullptr;
};

/// Calls body(GradientRow) for each z row of a slab. factors_of(segment) returns the factors of K.
template <typename FactorsOf, typename Body>
void for_each_gradient_row(const VoxelVolume& volume, int slab, FactorsOf&& factors_of,
                           Body&& body) {
  const float* above = slab + 1 < volume.num_slabs() ? volume.slab(slab + 1) : nullptr;
  thread_local std::vector<float> gradient;
  for (const projection::SampleSegment& segment : volume.grid().segments()) {
    const std::size_t count = static_cast<std::size_t>(segment.nx) * kernels::kLanes;
    gradient.resize(3 * count);
    float *x = gradient.data(), *y = x + count, *z = y + count;
    const GradientFactors factors = factors_of(segment);
    for (int k = 0; k < segment.nz; ++k) {
      gradient_of_row(segment, k, volume.rows_in_slab(slab), factors, volume.slab(slab), above, x,
                      y, z);
      body(GradientRow{factors, segment.origin + k * segment.stride_z(), count, x, y, z});
    }
  }
}

/// Adds Kᵀ p of a slab to `samples`. The volumes p are as in add_gradient_adjoint_of_row().
template <typename FactorsOf>
void add_gradient_adjoint(const VoxelVolume& p_x, const VoxelVolume& p_y, const VoxelVolume& p_z,
                          int slab, FactorsOf&& factors_of, float* samples) {
  const float* below = slab > 0 ? p_y.slab(slab - 1) : nullptr;
  for (const projection::SampleSegment& segment : p_x.grid().segments()) {
    const GradientFactors factors = factors_of(segment);
    for (int k = 0; k < segment.nz; ++k) {
      add_gradient_adjoint_of_row(segment, k, factors, p_x.slab(slab), p_y.slab(slab),
                                  p_z.slab(slab), below, samples);
    }
  }
}

}  // namespace tomofield::baseline
