#pragma once

#include <optional>
#include <string>

#include "baseline/solver.h"
#include "baseline/voxel_problem.h"
#include "tomofield/options.h"

namespace tomofield::baseline {

struct TvOptions {
  int iterations = 200;            ///< passes over all views
  std::optional<double> weight;    ///< λ, see reconstruct_tv; none: usual_weight()
  std::optional<Penalty> penalty;  ///< none: the smooth one
  double concavity = 1.6;          ///< τ of the concave penalty, in units of a voxel's noise
  bool non_negative = true;

  /// Returns the default weight. A concave penalty counts large steps less, and so needs a larger
  /// one.
  double usual_weight() const { return penalty == Penalty::kConcave ? 8.0 : 3.0; }
  /// Returns the facts of the method. Tuning may turn a penalty that is not given into the concave
  /// one, so only a smooth penalty that is given needs one volume less.
  MethodFacts facts() const { return {"tv", iterations, penalty == Penalty::kSmooth ? 5 : 6, 2}; }
};

/// Reconstructs by least squares with isotropic total variation:
///   min over x (>= 0)   ½ Σ ((A x − b) / σ_view)² + λ Σ h_x h_z φ(|∇x|)
/// The sums run over the rays that count and over the samples. Forward differences are divided by
/// the sample spacing (1 in y), and
///   smooth   φ(m) = m
///   concave  φ(m) = τ log(1 + m / τ)
/// Densities are in density units, so λ has the meaning of the main method's density variation
/// weight.
///
/// The concave penalty is majorised by a weighted variation, Σ w |∇x| with w = 1 / (1 + |∇x| / τ)
/// of an earlier x (Candès, Wakin and Boyd 2008). First w is constant; later it is renewed several
/// times.
///
/// The solver is the primal–dual hybrid gradient method of Chambolle and Pock (2011), with the
/// diagonal preconditioning of Pock and Chambolle (2011), equation 10 with α = 1, over-relaxed
/// after Condat (2013). `start` is the density of every voxel at first. Memory: five volumes
/// (concave: six), the rays and a dual of each ray.
Solution reconstruct_tv(VoxelProblem& problem, const TvOptions& options, double start,
                        const AfterIteration& after_iteration);

}  // namespace tomofield::baseline
