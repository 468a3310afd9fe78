#pragma once

#include <cstdint>
#include <vector>

#include "tilt_series/image.h"

namespace tomofield::tilt_series {

/// Marks as no measurements what lies between fill and image if they fade into each other, as
/// IMOD's TaperAtFill makes them: the image fades to the fill within its edge, or is continued
/// beyond it. `is_fill` tells which pixels are fill of mean `fill_value`. The values of marked
/// pixels stay.
///
/// Detail is the mean size of mixed second differences of neighbouring pixels, as a function of the
/// distance from the fill. It and the difference from the fill grow from nearly nothing at the fill
/// to what they are further within. The taper ends where there is nine tenths of the detail that
/// there is beyond. Without such growth nothing is marked, nor for a blur of up to two pixels.
void mask_taper(const std::vector<std::uint8_t>& is_fill, double fill_value, MaskedImage* image);

}  // namespace tomofield::tilt_series
