#pragma once

#include <cstdint>
#include <optional>

#include "geometry/raw_from_aligned.h"
#include "geometry/view_warp.h"
#include "tilt_series/image.h"
#include "tilt_series/motion_map.h"

namespace tomofield::tilt_series {

/// Maps places of an aligned view to the raw image. Centres are N/2 with pixel i at i + 1/2.
class RawPlaces {
 public:
  using Vector = geometry::ViewWarp::Vector;

  /// `width` and `height` are those of the raw image. `local` is the motion that the view has.
  RawPlaces(const geometry::RawFromAligned& transform, std::int64_t width, std::int64_t height,
            const std::optional<geometry::ViewWarp>& local)
      : transform_(transform), centre_(centre_of(width, height)) {
    if (local) motion_.emplace(*local);
  }

  /// Returns the place of (x, y), which is relative to the centre of the aligned view, in pixels
  /// from the centre of the raw image's first pixel.
  Vector of(double x, double y) const {
    const auto [qx, qy] = motion_ ? motion_->source_of(x, y) : Vector{x, y};
    return {transform_.m11 * qx + transform_.m12 * qy + centre_[0] + transform_.shift_x_px,
            transform_.m21 * qx + transform_.m22 * qy + centre_[1] + transform_.shift_y_px};
  }

  /// Returns the place of the centre of an image from the centre of its first pixel.
  static Vector centre_of(std::int64_t width, std::int64_t height) {
    return {0.5 * static_cast<double>(width - 1), 0.5 * static_cast<double>(height - 1)};
  }

 private:
  geometry::RawFromAligned transform_;
  Vector centre_;
  std::optional<MotionMap> motion_;
};

using geometry::RawFromAligned;

/// Resamples the raw image onto width × height aligned pixels. A shift by whole pixels alone copies
/// them; all else is band-limited interpolation, which blurs neither the specimen nor the noise
/// (BandLimitedImage). A pixel counts if its centre lies within the centres of the raw image's
/// outermost pixels, and if the raw pixels around it, 2 × 2 or fewer, are measurements. Centres are
/// N/2 with pixel i at i + 1/2. With local motion, the pixel at a place q + d(q) takes the value
/// that the raw image has for q.
MaskedImage align_image(const MaskedImage& raw, const RawFromAligned& transform, std::int64_t width,
                        std::int64_t height, const std::optional<geometry::ViewWarp>& local = {});

}  // namespace tomofield::tilt_series
