#pragma once

#include <span>

namespace tomofield::reconstruct {

/// Root mean square noise of the views' rays, in density units times pixels.
double typical_noise(std::span<const double> sigma_of_view);

/// τ of a concave penalty of the density's gradient in density units, for τ in units of a voxel's
/// noise: that of a voxel which is back-projected from N views is about 0.9 σ / √N (ramp filter).
/// Steps well above it are edges, which a concave penalty spares; below, noise would be taken for
/// edges. A τ much below any contrast leaves more local minima and no sharper edges, so it has a
/// least value.
double concavity(double in_voxel_noise, std::span<const double> sigma_of_view);

}  // namespace tomofield::reconstruct
