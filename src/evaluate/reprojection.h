#pragma once

#include <span>
#include <vector>

#include "base/volume.h"
#include "geometry/tilt_geometry.h"
#include "measurement/slab_views.h"
#include "measurement/view_errors.h"

namespace tomofield::evaluate {

/// Where a volume of one voxel a pixel lies in the views.
struct VolumePlace {
  geometry::TiltGeometry geometry;  ///< thickness: the volume's voxels in z
  geometry::Roi roi;                ///< its voxels in x and y are these pixels at zero tilt
  /// Nothing of the specimen lies outside of the volume. Otherwise only those rays count
  /// that stay within its x while they cross its thickness.
  bool is_whole_specimen = false;
};

/// Errors of `views` against line integrals through a volume, by the projector of the
/// main method (projection/slab_projector.h), after the least-squares scale and offset of each
/// view: of any volume, whatever its units and contrast. `measured` has the rows of the region,
/// `noise_weight` 1 / variance of the noise of every view of the series. The
/// sums are the same for any number of threads. Throws Error for a view of which no ray counts.
measurement::ViewErrors reprojection_errors(const base::Volume& volume, const VolumePlace& place,
                                            const measurement::SlabViews& measured,
                                            std::vector<int> views,
                                            std::span<const double> noise_weight);

}  // namespace tomofield::evaluate
