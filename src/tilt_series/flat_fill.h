#pragma once

#include "tilt_series/image.h"
#include "tilt_series/tilt_series.h"

namespace tomofield::tilt_series {

/// Marks the flat fill that alignment programs put outside a rotated or
/// shifted image as no measurement. Fill is a connected region of pixels with
/// exactly one value that reaches the image's edge and has at least 64 pixels.
///
/// An image of a specimen in front of nothing can look the same: bright data
/// without noise are exactly constant in empty space, where they are smallest.
/// A region at the smallest value of a bright image is therefore kept.
/// Returns the number of pixels marked.
std::int64_t mask_flat_fill(Contrast contrast, MaskedImage* image);

}  // namespace tomofield::tilt_series
