#pragma once

#include <memory>
#include <span>
#include <vector>

#include "objective/term.h"

namespace tomofield::objective {

/// Makes the terms of the loss in the order in which they are evaluated. A new term is a new file
/// and a line here.
std::vector<std::unique_ptr<Term>> make_terms(const TermContext& context);

/// Returns the factor on the weight of the density's variation: more than 1 if the penalty is
/// concave and there is little noise.
double variation_gain(const FitOptions& options, const measurement::Measurement& full);

// The weights of the variations are relative to the noise of the views. These functions convert
// them. The noise of a ray and the contrast of the views are in density units times pixels.

/// Returns the typical noise of a ray, 1 / √(mean of 1 / σ²) over the views. `sigma_of_view` has
/// the standard deviation σ of the noise of each view, above 0.
double typical_noise(std::span<const double> sigma_of_view);

/// Returns the parameter τ of a concave penalty in density units a pixel, for τ in units of a
/// voxel's noise. A back-projection of N views with a ramp filter has a noise of about 0.9 σ / √N
/// in a voxel. The penalty spares steps well above τ, which are edges. A smaller τ would spare
/// noise as well. τ has a lower bound, because a value far below any contrast makes no sharper
/// edges, but more local minima.
double concavity(double in_voxel_noise, std::span<const double> sigma_of_view);

/// Returns a factor on the weight of a concave penalty: 1, or more if the noise is small compared
/// with the contrast of the views. Few views and a missing wedge leave the density uncertain even
/// without noise. The factor grows as 1 / noise there, so that the weight, in units of the squared
/// residual, stops falling with the noise (docs/results/ablation.md, "The weight and the noise").
double gain_of_little_noise(double noise, double contrast);

}  // namespace tomofield::objective
