#pragma once

#include <nlohmann/json.hpp>
#include <vector>

#include "base/volume.h"
#include "evaluate/box.h"

namespace tomofield::evaluate {

/// Where a volume shows structure and where it shows none, in voxels of it.
struct Regions {
  std::vector<Box> foreground, background;
};

/// How clearly a foreground stands out and how smooth the background is, of a
/// volume that was mapped to [0, 1] by its smallest and largest voxel.
struct ContrastScore {
  double cnr = 0.0;  ///< |μf − μb| / √(½ (σf² + σb²)), contrast-to-noise ratio
  double enl = 0.0;  ///< μb² / σb², equivalent number of looks; depends on where 0 is
  double foreground_mean = 0.0, foreground_deviation = 0.0;  ///< normalised
  double background_mean = 0.0, background_deviation = 0.0;
  double low = 0.0, high = 0.0;  ///< what became 0 and 1
};

/// CNR and ENL as in the evaluation of Adaptive TensorDF (NeurIPS 2023). Variances are
/// divided by the number of voxels; a voxel counts once for each box that it is in. Either is
/// infinite where its denominator is zero. Throws Error for boxes that do not lie in the
/// volume, for a constant volume, and for voxels that are not finite.
ContrastScore contrast_score(const base::Volume& volume, const Regions& regions);

/// Regions for volumes of which nothing is known: of the cubes of a lattice (side: an
/// eighth of the shortest axis, from 4 to 32 voxels; the lattice is centred)
///   background: of the half whose means are nearest to the median of the means, the
///     one of smallest variance,
///   foreground: the one of largest CNR against that background.
/// Equal ones: the first in order of z, y, x. It is the same for a scaled or
/// inverted volume, but favours whatever the volume shows best: compare volumes on the regions
/// of one of them. Throws Error for fewer than 8 cubes and for voxels that are not finite.
Regions choose_regions(const base::Volume& volume);

nlohmann::json contrast_json(const ContrastScore& score, const Regions& regions);

}  // namespace tomofield::evaluate
