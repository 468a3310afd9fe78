#pragma once

#include <cstdint>

#include "tilt_series/image.h"

namespace tomofield::tilt_series {

/// Returns a size of an image after reduce_image: floor(size / factor). A quotient that misses an
/// integer by rounding alone counts as that integer.
std::int64_t reduced_size(std::int64_t size, double factor);

/// Reduces an image by any factor >= 1: each output pixel is the mean of the
/// valid input over its factor × factor square, input pixels weighted by the
/// area that they share with it, so that integer factors that divide the size
/// give plain box means. The centre of the image stays at the centre: what is
/// left over is lost at opposite edges alike. An output pixel is valid if at
/// least half of its area is.
MaskedImage reduce_image(const MaskedImage& image, double factor);

}  // namespace tomofield::tilt_series
