#pragma once

#include <cstdint>

#include "tomofield/options.h"

namespace tomofield::objective {

/// The weights of the loss (eq. 9), whose data term is ½ Σ (residual / σ)². The other terms use
/// weight / σ, where σ is the typical noise of a ray in density units times pixels, so that the
/// same weights serve every size and every series. A small σ gives the density's variation a larger
/// weight (noise_scale.h).
struct ObjectiveOptions {
  double density_variation = 14.0;  ///< total variation of the density; see usual_variation()
  double factor_variation = 0.0;    ///< total variation of the factors
  double boundary = 4.0;            ///< boundary consistency of leaves (eq. 6)
  double fourier = 0.0;             ///< isotropic Fourier prior (eq. 7)
  RingReference fourier_ring = RingReference::kMean;
  Penalty penalty = Penalty::kConcave;  ///< kind of both variations
  double concavity = 0.4;               ///< τ of the concave penalty, in units of a voxel's noise
  double gradient_floor = 1e-3;         ///< ε of both penalties, in density units a pixel
  int subsets = 16;                     ///< interleaved subsets of views: steps an epoch
  int ray_samples = 0;  ///< ray engine: N_max of eq. 10; 0: one a pixel of a leaf's diagonal
  std::int64_t rays_per_step = 0;  ///< ray engine: approximate; 0: all rays over `subsets`
  std::uint64_t seed = 1;
};

/// Returns the weight of the density's variation that usually goes with a penalty. A concave
/// penalty counts large steps less and so needs a larger weight (docs/results/ablation.md).
inline double usual_variation(Penalty penalty) {
  return penalty == Penalty::kSmooth ? 5.0 : ObjectiveOptions{}.density_variation;
}

}  // namespace tomofield::objective
