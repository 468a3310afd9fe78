#pragma once

#include <span>

namespace tomofield::evaluate {

/// The similarity of two sets of voxels, voxel by voxel.
struct PsnrScore {
  double raw_dB = 0.0;       ///< 10 log10(peak² / mean squared difference); infinite if equal
  double affine_dB = 0.0;    ///< PSNR of scale · reconstruction + offset
  double scale = 0.0;        ///< least squares on the truth; 0 for a constant reconstruction
  double offset = 0.0;       ///< in the truth's units
  double correlation = 0.0;  ///< Pearson's; 0 if one of the two is constant
  double peak = 0.0;         ///< max truth − min(0, min truth): 1 for a full-range phantom
};

/// Scores a reconstruction against the truth. Both have the same number of voxels. Sums are in
/// double and in a fixed order, whatever the thread count. Throws Error if the truth has no
/// positive peak or if one of the two has values that are not finite.
PsnrScore psnr(std::span<const float> reconstruction, std::span<const float> truth);

}  // namespace tomofield::evaluate
