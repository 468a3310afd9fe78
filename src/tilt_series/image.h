#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

namespace tomofield::tilt_series {

/// The use of a pixel of a view. Everything but 0 is a measurement.
enum PixelState : std::uint8_t {
  kNoMeasurement = 0,
  kMeasurement = 1,
  /// It belongs to a bead of which nobody has decided yet whether it is masked. Statistics of the
  /// specimen leave such pixels out.
  kUndecidedBead = 2,
};

/// An image [y, x] and which of its pixels are measurements (PixelState); the others are 0.
struct MaskedImage {
  std::int64_t width = 0;
  std::int64_t height = 0;
  std::vector<float> values;
  std::vector<std::uint8_t> valid;

  MaskedImage() = default;
  MaskedImage(std::int64_t w, std::int64_t h)
      : width(w),
        height(h),
        values(static_cast<std::size_t>(w * h)),
        valid(static_cast<std::size_t>(w * h), std::uint8_t{1}) {}

  std::size_t index(std::int64_t x, std::int64_t y) const {
    return static_cast<std::size_t>(y * width + x);
  }
};

}  // namespace tomofield::tilt_series
