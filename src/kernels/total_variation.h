#pragma once

#include <cstddef>

#include "kernels/lanes.h"

namespace tomofield::kernels {

/// How the gradient's magnitude is penalised. With m = √(|∇f|² + ε²):
///   smooth    φ(m) = m                        (concavity τ = 0)
///   concave   φ(m) = τ log(1 + m / τ)         (τ > 0; slope 1 at 0, so τ → ∞ is smooth)
struct VariationPenalty {
  float epsilon = 1e-3f;  ///< ε > 0
  float concavity = 0.0f;
};

/// Total variation of a decoded slab: weight · Σ φ over its voxels, with forward
/// differences (D_x / h_x, D_y, D_z / h_z) that are zero past the last x and z, or backward
/// ones in x or z.
/// Rows couple slabs: `above` is the first row of the next slab and flux_below
/// carries the y-flux of the last row of the one before, so that no slab
/// writes another's gradient and rows 15 | 16 are penalised like any others.
struct SlabVariation {
  const float* samples =
      nullptr;  ///< [z, x, lane] with stride_z between z rows; one float past the end is read
  float* gradient = nullptr;  ///< same layout, accumulated into
  int nx = 0, nz = 0;
  std::ptrdiff_t stride_z = 0;
  int num_rows =
      0;  ///< lanes that are rows of the volume; below kLanes only at its end (above null)
  const float* above =
      nullptr;  ///< [x, z] densities of the row past the last, or null at the volume's end
  float* flux = nullptr;  ///< [x, z]; in: y-flux of the row before the first (0 at the volume's
                          ///< start); out: of the last
  float per_hx = 1.0f, per_hz = 1.0f;  ///< 1 / sample spacing
  float weight = 0.0f;
  VariationPenalty penalty;
  bool backward_x = false, backward_z = false;  ///< differences to the sample before instead
};

/// Where sample (x, z) of a slab's variation lies, both counted in the direction
/// in which the differences run, in slab buffers and in [x, z] rows.
struct SampleOrder {
  std::ptrdiff_t first = 0, step_x = kLanes, step_z;
  std::ptrdiff_t row_first = 0, row_step_x, row_step_z = 1;
  explicit SampleOrder(const SlabVariation& s) : step_z(s.stride_z), row_step_x(s.nz) {
    if (s.backward_x) {
      first += (s.nx - 1) * step_x, row_first += (s.nx - 1) * row_step_x;
      step_x = -step_x, row_step_x = -row_step_x;
    }
    if (s.backward_z) {
      first += (s.nz - 1) * step_z, row_first += (s.nz - 1) * row_step_z;
      step_z = -step_z, row_step_z = -row_step_z;
    }
  }
  std::ptrdiff_t sample(int x, int z) const { return first + x * step_x + z * step_z; }
  std::ptrdiff_t row_sample(int x, int z) const {
    return row_first + x * row_step_x + z * row_step_z;
  }
};

/// Adds the gradient and returns the value (terms anchored at this slab's rows).
double slab_variation(const SlabVariation& slab);

/// The y-flux weight · φ′(m)/m · D_y of a single row, for the start of a band:
/// `row` and `next` are the densities [x, z] of this row and of the one after.
void row_flux(const SlabVariation& slab, const float* row, const float* next, float* flux);

}  // namespace tomofield::kernels
