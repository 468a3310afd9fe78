#pragma once

#include <span>

#include "geometry/tilt_geometry.h"
#include "geometry/view_correction.h"

namespace tomofield::alignment {

/// Removes the part of the corrections that the views cannot tell, because another place, pose or
/// size of the specimen explains it as well:
///
/// - shifts in x that are a combination of cos θ and sin θ: a translation of the specimen;
/// - the mean of the shifts in y: a translation as well;
/// - tilt corrections that are a cubic function of the tilt: the constant part is a rotation of the
///   specimen about Y, and a specimen that is stretched a little explains most of the rest;
/// - the mean logarithm of the magnifications: the size of a pixel.
///
/// The rest is the nearest in least squares. So the specimen stays where the given alignment has
/// it. The mean in-plane rotation stays: it is the direction of the tilt axis, which the views do
/// tell.
void remove_gauge(const geometry::TiltGeometry& geometry,
                  std::span<geometry::ViewCorrection> corrections);

}  // namespace tomofield::alignment
