#pragma once

#include <cstdint>

#include "baseline/voxel_volume.h"

namespace tomofield::baseline {

/// Steepest descent of a volume's total variation, Σ h_x h_z √(|∇x|² + ε²), with forward
/// differences divided by the sample spacing (1 in y). Lengths of steps are √(Σ h_x h_z change²).
class VariationDescent {
 public:
  VariationDescent(const projection::SampleGrid& grid, std::int64_t num_rows);

  /// Moves the densities by `length` straight down, and with `non_negative` to 0 where they would
  /// be below. Returns their variation before.
  double step(double length, bool non_negative, VoxelVolume& densities);

 private:
  double measure_directions(const VoxelVolume& densities);
  double measure_gradient();

  VoxelVolume px_, py_, pz_;  // ∇x / √(|∇x|² + ε²)
  VoxelVolume gradient_;      // of the variation, per h_x h_z
};

/// √(Σ h_x h_z (x − y)²) of a slab's samples, squared.
double squared_distance(const projection::SampleGrid& grid, const float* x, const float* y);

}  // namespace tomofield::baseline
