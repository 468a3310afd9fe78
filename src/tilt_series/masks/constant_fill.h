#pragma once

#include <cstdint>

#include "tilt_series/image.h"
#include "tomofield/options.h"

namespace tomofield::tilt_series {

/// Marks fill of exactly one value as no measurement: connected regions of
/// at least 64 equal pixels that hold a corner of the image. The area outside a rotated or
/// shifted image always holds one. Its outline is short: views of few grey levels have large
/// regions of one value, too, with measurements of others all over them.
///
/// Space without specimen looks the same where there is no noise. A region at
/// its value (the smallest of a bright image, the largest of a dark one) is
/// therefore kept, except for whole rows or columns at the edge that end at a
/// line of differing pixels, as a shift leaves them. The values of marked
/// pixels stay.
void mask_constant_fill(Contrast contrast, MaskedImage* image);

}  // namespace tomofield::tilt_series
