#pragma once

#include <cstdint>

#include "tomofield/options.h"

namespace tomofield::objective {

/// Weights of the loss (eq. 9). The data term is ½ Σ (residual / σ)². The weights of the variations
/// are relative to it and to the noise: weight / σ is used, with σ the typical noise of a ray in
/// density units times pixels, and a gain where σ is small (noise_scale.h). One setting then serves
/// every size and every series.
struct ObjectiveOptions {
  double density_variation = 14.0;  ///< total variation of the density; see usual_variation()
  double factor_variation = 0.0;    ///< total variation of the factors
  double boundary = 4.0;            ///< boundary consistency of leaves (eq. 6)
  double fourier = 0.0;             ///< isotropic Fourier prior (eq. 7)
  RingReference fourier_ring = RingReference::kMean;
  Penalty penalty = Penalty::kConcave;  ///< of both variations
  double concavity = 0.4;               ///< τ of the concave penalty, in units of a voxel's noise
  double gradient_floor = 1e-3;         ///< ε of both penalties, in density units a pixel
  int subsets = 16;                     ///< interleaved subsets of views: steps an epoch
  int ray_samples = 0;  ///< ray engine, N_max of eq. 10; 0: one a pixel of a leaf's diagonal
  std::int64_t rays_per_step = 0;  ///< ray engine: about; 0: all rays of an epoch over `subsets`
  std::uint64_t seed = 1;
};

/// Returns the weight of the density's variation that usually goes with a penalty. A concave
/// penalty counts large steps less and so needs a larger weight (docs/results/ablation.md).
inline double usual_variation(Penalty penalty) {
  return penalty == Penalty::kSmooth ? 5.0 : ObjectiveOptions{}.density_variation;
}

}  // namespace tomofield::objective
