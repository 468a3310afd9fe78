#pragma once

#include <cstdint>

#include "tilt_series/image.h"
#include "tomofield/options.h"

namespace tomofield::tilt_series {

/// Marks what alignment programs put outside a rotated or shifted image as no measurement:
/// - regions of exactly one value (constant_fill.h),
/// - flat wedges with straight inner edges along the image's sides (straight_fill.h), with the
///   two outermost rows and columns of the image,
/// - where there is neither, wedges of random values (noise_fill.h),
/// - and what fades from constant or flat fill into the image (taper.h).
/// Returns the number of pixels marked.
std::int64_t mask_fill(Contrast contrast, MaskedImage* image);

}  // namespace tomofield::tilt_series
