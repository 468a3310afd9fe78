#pragma once

#include <cstdint>

#include "tilt_series/image.h"
#include "tilt_series/tilt_series.h"

namespace tomofield::tilt_series {

/// Marks the flat fill that alignment programs put outside a rotated or
/// shifted image as no measurement: regions of exactly one value
/// (constant_fill.h), and flat wedges with straight inner edges along the
/// image's sides (straight_fill.h). Where there are wedges, two pixels of blur
/// at their edges and the two outermost rows and columns of the image are
/// marked as well. Returns the number of pixels marked.
std::int64_t mask_flat_fill(Contrast contrast, MaskedImage* image);

}  // namespace tomofield::tilt_series
