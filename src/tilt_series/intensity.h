#pragma once

#include <cstdint>
#include <vector>

#include "distributed/communicator.h"
#include "tilt_series/image.h"
#include "tomofield/options.h"

namespace tomofield::tilt_series {

/// The conversion of stored intensities I to line integrals. I0 is the intensity of an empty beam.
struct IntensityScale {
  Contrast contrast = Contrast::kDark;
  bool take_log = false;    ///< −ln(I / I0) instead of I0 − I; dark only
  double empty_beam = 0.0;  ///< I0; bright intensities need none
  double background = 0.0;  ///< is subtracted from bright intensities
  double log_base = 0.0;    ///< is added to I and I0 before the logarithm

  /// Converts the valid pixels. A transmission I / I0 below 1e-3 is raised to it before the
  /// logarithm: nothing so low is ever measured, it comes from noise and subtraction. Returns how
  /// many pixels were raised.
  std::int64_t convert(MaskedImage* image) const;
};

/// Appends the means of square blocks of valid pixels to `means`. They are much less noisy than
/// pixels, so that a high percentile of them is an intensity of the specimen's thinnest places and
/// not of the noise.
void append_block_means(const MaskedImage& image, std::vector<float>* means);

/// Returns I0: the percentile 99.5 of the block means of all views together, which is the
/// intensity of the thinnest half per cent of what was seen, beyond the reach of single hot
/// pixels; 0 if there are no means. `means` of views that another process owns are empty.
double estimate_empty_beam(const std::vector<std::vector<float>>& means_of_views,
                           const distributed::Communicator& processes);

/// Returns the background of a bright series: the percentile 0.5 of the same means.
double estimate_background(const std::vector<std::vector<float>>& means_of_views,
                           const distributed::Communicator& processes);

}  // namespace tomofield::tilt_series
