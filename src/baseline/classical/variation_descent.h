#pragma once

#include <cstdint>

#include "baseline/voxel_volume.h"

namespace tomofield::baseline {

/// Descends the total variation of a volume along its steepest direction:
///   Σ h_x h_z √(|∇x|² + ε²)
/// with forward differences divided by the sample spacing (1 in y). The length of a step is
///   √(Σ h_x h_z change²).
class VariationDescent {
 public:
  VariationDescent(const projection::SampleGrid& grid, std::int64_t num_rows);

  /// Moves the densities by `length` along the steepest descent. With `non_negative`, negative ones
  /// become 0. Returns their variation before the step.
  double step(double length, bool non_negative, VoxelVolume& densities);

 private:
  double measure_directions(const VoxelVolume& densities);
  double measure_gradient();

  VoxelVolume px_, py_, pz_;  // ∇x / √(|∇x|² + ε²)
  VoxelVolume gradient_;      // gradient of the variation, divided by h_x h_z
};

/// Returns Σ h_x h_z (x − y)² of a slab's samples.
double squared_distance(const projection::SampleGrid& grid, const float* x, const float* y);

}  // namespace tomofield::baseline
