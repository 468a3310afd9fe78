#pragma once

#include <array>
#include <cstdint>

#include "fourier/image_transform.h"
#include "tilt_series/image.h"

namespace tomofield::alignment {

using fourier::ImageTransform;

/// The highest place of a correlation.
struct ShiftPeak {
  std::array<double, 2> moved_px{};  ///< the reference at q is found in the image at q + moved_px
  double correlation = 0.0;          ///< at the peak, −1 to 1
  double prominence = 0.0;  ///< (peak − mean) / standard deviation of the whole correlation
};

/// A reference: its values (0 where it has none) and how much each pixel counts.
struct Reference {
  ImageTransform::Image values, weights;
};

/// Finds the shift within ± `range_px` at which an image agrees best with the reference, to a
/// fraction of a pixel. It is the correlation coefficient over the pixels that both have (Padfield
/// 2012, without the local means, which both images have lost). Both must have the size of the
/// transform, which is so large that nothing wraps around.
ShiftPeak find_shift(const ImageTransform& transform, const Reference& reference,
                     const tilt_series::MaskedImage& image, const std::array<double, 2>& range_px);

}  // namespace tomofield::alignment
