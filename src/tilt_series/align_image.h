#pragma once

#include <optional>

#include "geometry/raw_from_aligned.h"
#include "geometry/view_warp.h"
#include "tilt_series/image.h"

namespace tomofield::tilt_series {

using geometry::RawFromAligned;

/// Resamples the raw image onto width × height aligned pixels by cubic
/// convolution (Keys 1981, a = −1/2: Catmull–Rom), linear in the outermost
/// pixel of the raw image. Pixels whose centre lies outside the centres of
/// the raw image's outermost pixels, or that need a pixel which is no
/// measurement, are invalid. Centres are N/2 with pixel i at i + 1/2. With
/// local motion, the pixel at a place q + d(q) takes the value that the raw
/// image has for q.
MaskedImage align_image(const MaskedImage& raw, const RawFromAligned& transform, std::int64_t width,
                        std::int64_t height, const std::optional<geometry::ViewWarp>& local = {});

/// Returns nearly the means over bin × bin pixels of align_image(), from its first column and its
/// row `first_row` on, with a fraction of the work: the means over the squares of the raw image are
/// resampled at the centres of the wide pixels. A mean counts if at least half of its pixels do.
/// `bin` must be even.
MaskedImage align_means(const MaskedImage& raw, const RawFromAligned& transform, std::int64_t width,
                        std::int64_t height, std::int64_t first_row, int bin,
                        const std::optional<geometry::ViewWarp>& local = {});

}  // namespace tomofield::tilt_series
