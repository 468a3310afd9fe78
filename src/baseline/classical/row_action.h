#pragma once

#include <span>

#include "baseline/voxel_problem.h"

namespace tomofield::baseline {

/// The functions below are the parts of a step of SIRT or SART with some of the views, a pair of
/// slabs at a time:
///   x ← x + relaxation · C Aᵀ R W (b − A x)
/// R holds the inverse row sums of A, W = 1/σ² of each view, and C the inverse column sums of W A
/// over the rays that count.

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

}  // namespace tomofield::baseline
