#pragma once

#include <span>

namespace tomofield::objective {

/// Root mean square noise of the views' rays, in density units times pixels.
double typical_noise(std::span<const double> sigma_of_view);

/// τ of a concave penalty of the density's gradient in density units, for τ in units of a voxel's
/// noise: that of a voxel which is back-projected from N views is about 0.9 σ / √N (ramp filter).
/// Steps well above it are edges, which a concave penalty spares; below, noise would be taken for
/// edges. A τ much below any contrast leaves more local minima and no sharper edges, so it has a
/// least value.
double concavity(double in_voxel_noise, std::span<const double> sigma_of_view);

/// How many times its weight in units of the noise a concave penalty has: more than once where
/// there is little noise beside the views' contrast (both in density units times pixels). What few
/// views and the missing wedge leave open does not become less with the noise, so that below some
/// noise the weight no longer depends on it, in units of the squared residual
/// (docs/results/ablation.md, "The weight and the noise").
double gain_of_little_noise(double noise, double contrast);

}  // namespace tomofield::objective
