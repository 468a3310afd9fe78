#pragma once

#include <optional>

#include "geometry/raw_from_aligned.h"
#include "geometry/view_warp.h"
#include "tilt_series/image.h"

namespace tomofield::tilt_series {

using geometry::RawFromAligned;

/// Resamples the raw image onto width × height aligned pixels. A shift by whole pixels alone copies
/// them; all else is band-limited interpolation, which blurs neither the specimen nor the noise
/// (BandLimitedImage). A pixel counts if its centre lies within the centres of the raw image's
/// outermost pixels, and if the raw pixels around it, 2 × 2 or fewer, are measurements. Centres are
/// N/2 with pixel i at i + 1/2. With local motion, the pixel at a place q + d(q) takes the value
/// that the raw image has for q.
MaskedImage align_image(const MaskedImage& raw, const RawFromAligned& transform, std::int64_t width,
                        std::int64_t height, const std::optional<geometry::ViewWarp>& local = {});

}  // namespace tomofield::tilt_series
