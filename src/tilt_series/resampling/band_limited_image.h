#pragma once

#include <cstddef>
#include <cstdint>

#include "fourier/real_transform.h"
#include "tilt_series/image.h"

namespace tomofield::tilt_series {

/// Gives the values between the pixels of an image, without blurring it: frequencies up to 0.48
/// cycles a pixel keep their amplitudes to 2·10⁻⁴, so that white noise stays white.
///
/// The image is extended by its mirror images, and its Fourier transform is taken to a finer grid
/// (5/4 of the pixels), divided by the transform of a short kernel. Each value is then a sum over
/// 8 × 8 of the finer pixels (a non-uniform Fourier transform of type 2, Dutt and Rokhlin 1993,
/// with the Kaiser–Bessel kernel of Beatty, Nishimura and Pauly 2005).
///
/// Pixels without a measurement count as what fill_invalid() puts there. Thread-safe. The
/// construction works on one thread.
class BandLimitedImage {
 public:
  explicit BandLimitedImage(const MaskedImage& image);

  /// Returns the value at a place within the centres of the outermost pixels. (0, 0) is the centre
  /// of the first pixel.
  float at(double x, double y) const;

  /// Returns the bytes that the construction takes for an image of that number of pixels.
  static std::size_t memory(double pixels);

 private:
  fourier::RealTransform::Image fine_;
  std::int64_t fine_width_ = 0;
  float mean_ = 0.0f;  // is left out of fine_, for precision
};

}  // namespace tomofield::tilt_series
