#pragma once

namespace tomofield::alignment {

/// Describes a slab in the tilted views.
struct SlabPose {
  double thickness_px = 0.0;  ///< in pixels of the images
  double pitch_deg = 0.0;     ///< is added to all tilt angles: the slab lies level with them
  /// Is subtracted from the x-axis tilts of all views: the slab lies level with them.
  double x_tilt_deg = 0.0;
};

/// The most likely pose, and the standard error of each of its numbers.
struct FoundPose {
  SlabPose pose, error;
};

}  // namespace tomofield::alignment
