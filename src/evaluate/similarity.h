#pragma once

#include <filesystem>
#include <span>

#include "base/volume.h"
#include "evaluate/box.h"
#include "evaluate/volume_pair.h"

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

/// The structural similarity of two volumes; 1 if they are equal.
struct SsimScore {
  double raw = 0.0;
  double affine = 0.0;  ///< SSIM of scale · reconstruction + offset
};

/// Computes the mean structural similarity in three dimensions (Wang et al., IEEE TIP 13, 2004): a
/// uniform window of 7³ voxels, sample covariances, K1 = 0.01, K2 = 0.03 and the full data range
/// `peak`, over the windows that lie wholly inside. scikit-image's structural_similarity gives the
/// same by default. The affine score comes from the same window sums, without another pass.
///
/// Both volumes have the same shape. Working memory is a band of rows a thread, a few MiB. Throws
/// Error if an axis is shorter than the window.
SsimScore ssim(const base::Volume& reconstruction, const base::Volume& truth, double peak,
               double scale, double offset);

/// The scores of one volume against another.
struct Comparison {
  PsnrScore psnr;
  SsimScore ssim;
  base::Box box;  ///< the voxels compared, in the truth's coordinates
};

/// Scores the first volume of a pair against the second, the truth. The peak of the PSNR is the
/// truth's.
Comparison compare(const VolumePair& pair);

}  // namespace tomofield::evaluate
