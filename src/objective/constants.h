#pragma once

#include "tomofield/options.h"

namespace tomofield::objective {

// Constants of both penalties of total variation, which nobody has to choose.
inline constexpr double kConcavity = 0.4;  ///< τ of the concave one, in units of a voxel's noise
inline constexpr double kGradientFloor = 1e-3;  ///< ε, in density units a pixel

/// Returns the weight of the density's variation that usually goes with a penalty. A concave
/// penalty counts large steps less and so needs a larger weight (docs/results/ablation.md).
inline double usual_variation(Penalty penalty) {
  return penalty == Penalty::kSmooth ? 5.0 : *FitOptions{}.density_variation;
}

}  // namespace tomofield::objective
