#pragma once

#include <cstdint>

#include "baseline/solver.h"
#include "baseline/voxel_problem.h"
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

struct SartTvOptions {
  int iterations = 20;
  int subsets = 10;         ///< interleaved subsets of views; at most one a view
  double relaxation = 1.0;  ///< in the first pass; times 0.97 in each pass after it
  int tv_steps = 20;        ///< steps down the variation after each pass
  double weight = 1.0;      ///< total length of these steps over the change by the pass
  bool non_negative = true;

  MethodFacts facts() const { return {"sart-tv", iterations, 5, 1, 3}; }
};

/// Reconstructs by ordered-subset SART (Andersen and Kak 1984) with steps down the total variation
/// between its passes, as in ASD-POCS (Sidky and Pan 2008). A pass takes the step of sirt.h
/// with each subset in turn. Then `tv_steps` steps of length
///   weight · |x after the pass − x before| / tv_steps
/// reduce the variation (VariationDescent), so they shrink as the data are met. The relaxation
/// shrinks as well; otherwise the subsets would pull to and fro for ever. The method has no
/// objective, so the solution reports its data loss as one. `start` is the density of every voxel
/// at first. Memory: five volumes and the rays.
Solution reconstruct_sart_tv(VoxelProblem& problem, const SartTvOptions& options, double start,
                             const AfterIteration& after_iteration);

}  // namespace tomofield::baseline
