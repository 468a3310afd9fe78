#pragma once

#include <vector>

#include "base/volume.h"
#include "evaluate/box.h"

namespace tomofield::evaluate {

/// The boxes in which a volume shows structure and those in which it shows none, in its voxels.
struct Regions {
  std::vector<base::Box> foreground, background;
};

/// The contrast of a volume that was mapped to [0, 1] by its smallest and its largest voxel: how
/// clearly the foreground stands out and how smooth the background is.
struct ContrastScore {
  double cnr = 0.0;  ///< |μf − μb| / √(½ (σf² + σb²)), contrast-to-noise ratio
  double enl = 0.0;  ///< μb² / σb², equivalent number of looks; depends on where 0 is
  double foreground_mean = 0.0, foreground_deviation = 0.0;  ///< normalised
  double background_mean = 0.0, background_deviation = 0.0;
  double low = 0.0, high = 0.0;  ///< the values that were mapped to 0 and to 1
};

/// Computes CNR and ENL as the evaluation of Adaptive TensorDF (NeurIPS 2023) does. Variances are
/// divided by the number of voxels. A voxel counts once for each box that it is in. A score is
/// infinite where its denominator is zero. Throws Error for boxes that do not lie in the volume,
/// for a constant volume, and for voxels that are not finite.
ContrastScore contrast_score(const base::Volume& volume, const Regions& regions);

/// Chooses the regions of a volume of which nothing is known. The candidates are the cubes of a
/// centred lattice; their side is an eighth of the shortest axis, from 4 to 32 voxels.
///   background: the cube of smallest variance among the half of the cubes whose means are nearest
///     to the median of the means,
///   foreground: the cube of largest CNR against that background.
/// The first in order of z, y, x wins a tie. A scaled or inverted volume gets the same regions. The
/// choice favours whatever the volume shows best, so compare several volumes on the regions of one
/// of them. Throws Error for fewer than 8 cubes and for voxels that are not finite.
Regions choose_regions(const base::Volume& volume);

}  // namespace tomofield::evaluate
