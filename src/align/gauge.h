#pragma once

#include <span>

#include "geometry/tilt_geometry.h"
#include "geometry/view_correction.h"

namespace tomofield::align {

/// Removes the part of the corrections that the views cannot tell, because another place, pose or
/// size of the specimen explains it as well:
///
/// - shifts in x that are a combination of cos θ and sin θ: a translation of the specimen;
/// - the mean of the shifts in y: a translation as well;
/// - the mean of the tilt corrections: a rotation of the specimen about Y;
/// - the mean logarithm of the magnifications: the size of a pixel.
///
/// The rest is the nearest in least squares. So the specimen stays where the given alignment has
/// it. The mean in-plane rotation stays: it is the direction of the tilt axis, which the views do
/// tell.
void remove_gauge(const geometry::TiltGeometry& geometry,
                  std::span<geometry::ViewCorrection> corrections);

}  // namespace tomofield::align
