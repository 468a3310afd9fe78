#pragma once

#include <span>

#include "baseline/voxel_problem.h"

namespace tomofield::baseline {

/// The parts of a step of SIRT or SART with some of the views, a pair of slabs at a time:
///   x ← x + relaxation · C Aᵀ R W (b − A x)
/// with R the inverse row sums of A, W = 1/σ² of each view, and C the inverse column
/// sums of W A over the rays that count.

/// Multiplies detectors of residuals by W R; returns Σ residual² W R.
double weigh_rays(const VoxelProblem& problem, const SlabPair& slabs, std::span<const int> views,
                  float* residuals);

/// inverse ← C, 0 where no ray passes. `inverse` is zero before; writes `detector`.
void inverse_column_sums(const VoxelProblem& problem, const SlabPair& slabs,
                         std::span<const int> views, float* detector, float* inverse);

/// densities ← densities − relaxation · inverse · gradient, and with `non_negative` at least 0.
void take_step(const projection::SampleGrid& grid, const SlabPair& slabs, double relaxation,
               bool non_negative, const float* inverse_columns, const float* gradient,
               float* densities);

}  // namespace tomofield::baseline
