#pragma once

#include "tilt_series/image.h"

namespace tomofield::tilt_series {

/// Estimates the standard deviation of the noise of a view from the view alone.
///
/// The mixed second difference v(x,y) − v(x+1,y) − v(x,y+1) + v(x+1,y+1)
/// cancels whatever varies slowly and has four times the variance of white
/// noise; its median absolute deviation ignores edges and beads (Donoho and
/// Johnstone 1994 do the same with the finest wavelets). Interpolated images
/// have noise that is correlated over a pixel or two, which looks too small at
/// this scale but not after averaging 2 × 2 pixels. The result is therefore a
/// white-noise equivalent: the larger of the estimates at one and at two
/// pixels (the latter times two). Structure also grows with the scale, but
/// faster and faster, while correlated noise levels off. The second scale therefore
/// counts only if it is 1.4 times the first and the step to four pixels is no larger.
///
/// Values of few grey levels hide smaller noise: the result is at least the error of rounding, the
/// smallest of these differences over √12. It is always positive, and at least 1e-3 of the view's
/// own standard deviation, since noise-free data would get infinite weight.
double estimate_noise_sigma(const MaskedImage& view);

}  // namespace tomofield::tilt_series
