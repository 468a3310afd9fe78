#pragma once

#include "tilt_series/image.h"

namespace tomofield::tilt_series {

/// Where an aligned pixel comes from in the raw image: with q relative to the
/// centre of the aligned image and p relative to the centre of the raw one, in
/// unbinned pixels, p = M q + shift.
struct RawFromAligned {
  double m11 = 1.0, m12 = 0.0, m21 = 0.0, m22 = 1.0;
  double shift_x_px = 0.0, shift_y_px = 0.0;

  bool is_identity() const;
};

/// The raw image resampled onto width × height aligned pixels by cubic
/// convolution (Keys 1981, a = −1/2: Catmull–Rom), linear in the outermost
/// pixel of the raw image. Pixels whose centre lies outside the centres of
/// the raw image's outermost pixels, or that need a pixel which is no
/// measurement, are invalid. Centres are N/2 with pixel i at i + 1/2.
MaskedImage align_image(const MaskedImage& raw, const RawFromAligned& transform, std::int64_t width,
                        std::int64_t height);

}  // namespace tomofield::tilt_series
