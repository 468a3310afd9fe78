#pragma once

#include <array>
#include <optional>

#include "tilt_series/image.h"

namespace tomofield::tilt_series {

/// Returns the place (x, y) of a round spot of about this diameter in pixels, which is known within
/// a pixel: there a Gaussian on a sloping ground agrees best with the pixels up to a diameter away.
/// Returns nothing if it does not converge near the given place, or too little was measured. Pixel
/// i covers [i, i + 1).
std::optional<std::array<double, 2>> spot_place(const MaskedImage& image, double x_px, double y_px,
                                                double diameter_px);

}  // namespace tomofield::tilt_series
