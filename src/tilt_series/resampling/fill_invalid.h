#pragma once

#include <vector>

#include "tilt_series/image.h"

namespace tomofield::tilt_series {

/// Returns the values [y, x] of an image, with smooth ones in the place of pixels that are no
/// measurements: those of the means of the measurements in the smallest squares of 2, 4, 8 … pixels
/// around them, interpolated linearly (Gortler, Grzeszczuk, Szeliski and Cohen 1996: pull-push).
/// Returns zeros if there are no measurements.
std::vector<float> fill_invalid(const MaskedImage& image);

}  // namespace tomofield::tilt_series
