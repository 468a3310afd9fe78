#pragma once

#include <optional>

#include "geometry/raw_from_aligned.h"
#include "geometry/view_warp.h"
#include "tilt_series/image.h"

namespace tomofield::tilt_series {

/// Returns nearly the means over bin × bin pixels of align_image(), from its first column and its
/// row `first_row` on, with a fraction of the work: the means over the squares of the raw image are
/// resampled at the centres of the wide pixels by cubic convolution (Keys 1981, a = −1/2), which is
/// enough for the registration of coarse stages. A mean counts if at least half of its pixels do.
/// `bin` must be even.
MaskedImage align_means(const MaskedImage& raw, const geometry::RawFromAligned& transform,
                        std::int64_t width, std::int64_t height, std::int64_t first_row, int bin,
                        const std::optional<geometry::ViewWarp>& local = {});

}  // namespace tomofield::tilt_series
