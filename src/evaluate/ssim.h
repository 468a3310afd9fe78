#pragma once

#include "base/volume.h"

namespace tomofield::evaluate {

struct SsimScore {
  double raw = 0.0;
  double affine = 0.0;  ///< of scale · reconstruction + offset
};

/// Mean structural similarity in three dimensions (Wang et al., IEEE TIP 13,
/// 2004) with a uniform window of 7³ voxels, sample covariances, K1 = 0.01, K2 =
/// 0.03 and the full data range `peak`, over the windows that lie wholly inside:
/// what scikit-image's structural_similarity gives by default. The affine score
/// comes from the same window sums, at no extra pass.
///
/// Both volumes have the same shape. A band of rows is in memory beside them, a
/// few MiB a thread. Throws Error if an axis is shorter than the window.
SsimScore ssim(const base::Volume& reconstruction, const base::Volume& truth, double peak,
               double scale, double offset);

}  // namespace tomofield::evaluate
