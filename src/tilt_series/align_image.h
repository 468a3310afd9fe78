#pragma once

#include "geometry/raw_from_aligned.h"
#include "tilt_series/image.h"

namespace tomofield::tilt_series {

using geometry::RawFromAligned;

/// Resamples the raw image onto width × height aligned pixels by cubic
/// convolution (Keys 1981, a = −1/2: Catmull–Rom), linear in the outermost
/// pixel of the raw image. Pixels whose centre lies outside the centres of
/// the raw image's outermost pixels, or that need a pixel which is no
/// measurement, are invalid. Centres are N/2 with pixel i at i + 1/2.
MaskedImage align_image(const MaskedImage& raw, const RawFromAligned& transform, std::int64_t width,
                        std::int64_t height);

}  // namespace tomofield::tilt_series
