#pragma once

#include <filesystem>
#include <span>
#include <vector>

#include "base/volume.h"
#include "geometry/tilt_geometry.h"
#include "measurement/prepare.h"
#include "measurement/slab_views.h"
#include "measurement/view_residuals.h"
#include "tilt_series/tilt_series.h"

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

/// A volume of any program and the series that its projections are compared with.
struct VolumeScoreOptions {
  std::filesystem::path volume;  ///< MRC, axes x, y, z, one voxel a binned pixel
  tilt_series::TiltSeriesOptions input;
  SpecimenOptions specimen;  ///< `thickness` is the volume's own
  bool with_margin = true;   ///< false: the specimen ends inside the region of interest
  int hold_out = 0;          ///< score every Nth view, as reconstruct holds them out; 0: all
};

/// The reprojection error of a volume.
struct VolumeScore {
  measurement::ViewErrors errors;
  std::vector<double> tilt_deg;  ///< one a scored view
  double unit = 1.0;             ///< data units that predictions and offsets are divided by
};

/// Computes the reprojection error of a volume (reprojection_errors()). Throws Error for a volume
/// that is not of the region of interest, and for a series that cannot be read.
VolumeScore score_volume(const VolumeScoreOptions& options);

}  // namespace tomofield::evaluate
