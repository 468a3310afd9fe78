#pragma once

#include <cstdint>
#include <span>
#include <vector>

namespace tomofield::alignment {

/// Returns an image [y, x] of this width, blurred by a Gaussian whose standard deviation is
/// `sigma_px`. Pixels beyond the border count as the nearest pixel of the border.
std::vector<float> gaussian_blur(std::span<const float> image, std::int64_t width, double sigma_px);

}  // namespace tomofield::alignment
