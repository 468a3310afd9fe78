#pragma once

#include <span>
#include <vector>

#include "base/volume.h"
#include "geometry/tilt_geometry.h"
#include "measurement/slab_views.h"
#include "measurement/view_errors.h"
#include "tomofield/options.h"

namespace tomofield::evaluate {

/// The place of a volume of one voxel a pixel in the views.
struct VolumePlace {
  geometry::TiltGeometry geometry;  ///< thickness: the volume's voxels in z
  Rectangle roi;                    ///< the pixels of its voxels at zero tilt
  /// True if nothing of the specimen lies outside of the volume. Otherwise a ray counts only if it
  /// stays within the volume's x while it crosses the thickness.
  bool is_whole_specimen = false;
};

/// Computes the errors of `views` against line integrals through a volume, after the least-squares
/// scale and offset of each view. The units and the contrast of the volume therefore do not matter.
/// The projector is the main method's (projection/slab_projector.h). `measured` has the rows of the
/// region; `noise_weight` is 1 / variance of the noise of every view of the series. The sums are
/// the same for any number of threads. Throws Error for a view of which no ray counts.
measurement::ViewErrors reprojection_errors(const base::Volume& volume, const VolumePlace& place,
                                            const measurement::SlabViews& measured,
                                            std::vector<int> views,
                                            std::span<const double> noise_weight);

}  // namespace tomofield::evaluate
