#pragma once

#include "base/volume.h"

namespace tomofield::evaluate {

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

}  // namespace tomofield::evaluate
