#pragma once

#include <array>
#include <cstdint>

#include "tilt_series/image.h"

namespace tomofield::alignment {

/// The tilt angle of a view, and where the centre of the corrected view lies in the image, relative
/// to the centre of the image.
struct ViewPose {
  double tilt_deg = 0.0;
  std::array<double, 2> shift_px{};
};

/// Returns the image minus its mean around each pixel, under a Gaussian of `sigma_px`. Pixels that
/// are no measurements count nowhere and stay 0.
tilt_series::MaskedImage without_trend(const tilt_series::MaskedImage& image, double sigma_px);

/// Returns a view of width × height pixels, corrected and stretched in X by cos(seen_at) / cos θ.
/// The tilt axis is then +Y through the centre, and a thin specimen looks as it does in a view at
/// the angle `seen_at_deg`.
tilt_series::MaskedImage stretched_view(const tilt_series::MaskedImage& image, const ViewPose& pose,
                                        double seen_at_deg, std::int64_t width,
                                        std::int64_t height);

}  // namespace tomofield::alignment
