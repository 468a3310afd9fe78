#pragma once

#include <cstddef>

#include "base/range.h"
#include "kernels/lanes.h"

namespace tomofield::kernels {

/// The penalty φ on the gradient's magnitude m = √(|∇f|² + ε²):
///   smooth    φ(m) = m                        (concavity τ = 0)
///   concave   φ(m) = τ log(1 + m / τ)         (τ > 0; slope 1 at 0, so τ → ∞ is smooth)
struct VariationPenalty {
  float epsilon = 1e-3f;  ///< ε > 0
  float concavity = 0.0f;
};

/// A row of densities. The density of sample (x, z) is data[x step_x + z step_z].
struct DensityRow {
  const float* data = nullptr;
  std::ptrdiff_t step_x = 0, step_z = 1;
};

/// The total variation of a decoded slab: weight · Σ φ over its voxels. The differences
/// (D_x / h_x, D_y, D_z / h_z) are forward and zero past the last x and z; in x and z they may be
/// backward instead. A range of x can be computed by itself; it writes nothing outside its range.
///
/// Slabs are coupled through their rows. `above` is the first row of the next slab, and `flux`
/// carries the y-flux of the last row of the slab before. No slab therefore writes another slab's
/// gradient, and the pair of rows 15 and 16 is penalised like any other.
struct SlabVariation {
  const float* samples =
      nullptr;  ///< [z, x, lane], stride_z floats between z; one float past the end is read
  float* gradient = nullptr;  ///< same layout, accumulated into
  int nx = 0, nz = 0;
  base::Range x;  ///< samples along x to compute, counted in the direction of the differences
  std::ptrdiff_t stride_z = 0;
  int num_rows =
      0;  ///< lanes that are rows of the volume; below kLanes only at its end, without `above`
  DensityRow above;       ///< the row past the last one; no data at the volume's end
  float* flux = nullptr;  ///< [x, z]; in: y-flux of the row before the first (0 at the volume's
                          ///< start); out: y-flux of the last row
  float per_hx = 1.0f, per_hz = 1.0f;  ///< 1 / sample spacing
  float weight = 0.0f;
  VariationPenalty penalty;
  bool backward_x = false, backward_z = false;  ///< differences to the sample before instead
};

/// Returns the position of sample (x, z) in an array with the given steps. x and z are counted in
/// the direction in which the differences run.
struct SampleOrder {
  std::ptrdiff_t first = 0, step_x, step_z;
  SampleOrder(const SlabVariation& s, std::ptrdiff_t along_x, std::ptrdiff_t along_z)
      : step_x(along_x), step_z(along_z) {
    if (s.backward_x) {
      first += (s.nx - 1) * step_x;
      step_x = -step_x;
    }
    if (s.backward_z) {
      first += (s.nz - 1) * step_z;
      step_z = -step_z;
    }
  }
  std::ptrdiff_t operator()(int x, int z) const { return first + x * step_x + z * step_z; }
};

/// Adds the gradient of samples slab.x and returns the value of their terms in this slab's rows.
double slab_variation(const SlabVariation& slab);

/// Computes the y-flux weight · φ′(m)/m · D_y of a single row at samples slab.x, to start with.
/// `row` and `next` are the densities of this row and of the one after it; flux is [x, z].
void row_flux(const SlabVariation& slab, const DensityRow& row, const DensityRow& next,
              float* flux);

/// Clears the flux of samples slab.x, for the start of the volume.
void clear_flux(const SlabVariation& slab);

}  // namespace tomofield::kernels
