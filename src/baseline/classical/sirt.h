#pragma once

#include <span>

#include "baseline/solver.h"
#include "baseline/voxel_problem.h"

namespace tomofield::baseline {

// The functions below are the parts of a step of SIRT or SART with some of the views, a pair of
// slabs at a time:
//   x ← x + relaxation · C Aᵀ R W (b − A x)
// R holds the inverse row sums of A, W = 1/σ² of each view, and C the inverse column sums of W A
// over the rays that count.

/// Multiplies detectors of residuals by W R; returns Σ residual² W R.
double weigh_rays(const VoxelProblem& problem, const SlabPair& slabs, std::span<const int> views,
                  float* residuals);

/// Sets inverse ← C, and 0 where no ray passes. `inverse` must be zero before. Overwrites
/// `detector`.
void inverse_column_sums(const VoxelProblem& problem, const SlabPair& slabs,
                         std::span<const int> views, float* detector, float* inverse);

/// Sets densities ← densities − relaxation · inverse · gradient. With `non_negative`, values below
/// 0 become 0.
void take_step(const projection::SampleGrid& grid, const SlabPair& slabs, double relaxation,
               bool non_negative, const float* inverse_columns, const float* gradient,
               float* densities);

struct SirtOptions {
  int iterations = 40;      ///< best on phantoms with noise 0.05, docs/results/noise.md
  double relaxation = 1.0;  ///< converges for 0 < relaxation < 2
  bool non_negative = true;

  MethodFacts facts() const { return {"sirt", iterations, 2, 1}; }
};

/// Reconstructs by weighted simultaneous iterative reconstruction (Gilbert 1972) from zero
/// densities. An iteration is the step above with all views at once. It minimises
///   ½ Σ (residual / σ)² / ray length.
/// The method has no prior, and must therefore stop before it has fitted the noise.
Solution reconstruct_sirt(VoxelProblem& problem, const SirtOptions& options,
                          const AfterIteration& after_iteration);

}  // namespace tomofield::baseline
