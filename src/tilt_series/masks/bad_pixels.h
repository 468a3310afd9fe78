#pragma once

#include <cstdint>

#include "tilt_series/image.h"

namespace tomofield::tilt_series {

/// Marks hot and dead pixels as no measurements and returns how many there are.
///
/// They are single pixels, at most three beside each other, that lie more than six
/// standard deviations of the image from its mean. They also lie beyond all but two of
/// the 24 pixels around, by three times the spread of those. Nothing that a
/// camera's optics image is that sharp, so neither specimen nor bead is marked.
/// The image must be as the camera read it, before any resampling.
std::int64_t mask_bad_pixels(MaskedImage* image);

}  // namespace tomofield::tilt_series
