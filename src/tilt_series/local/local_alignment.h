#pragma once

#include <filesystem>
#include <functional>
#include <span>
#include <vector>

#include "geometry/view_warp.h"
#include "io/tables/alignment_files.h"
#include "io/tables/imod_local.h"

namespace tomofield::tilt_series {

/// Where what belongs at an aligned place is found by the local alignment of another program. Both
/// are pixels before binning, relative to the centre of the aligned view.
using LocalPlace = std::function<geometry::ViewWarp::Vector(double x, double y)>;

/// The local alignment of a view as a warp, and how far it is from what the other program says.
struct FittedWarp {
  geometry::ViewWarp warp;
  double rms_px = 0.0;        ///< of the displacements over the view
  double left_over_px = 0.0;  ///< root mean square of their difference from the other program's
  double largest_stated_px = 0.0;  ///< distance between an aligned place and its raw one
};

/// Returns the warp whose nodes have the displacements that a local alignment gives them.
FittedWarp warp_through(double width_px, double height_px, const LocalPlace& place);

/// Returns the places of AreTomo's patch shifts. A raw pixel lies at a + L(a) + shift for the
/// aligned place q, with a = R(rotation) q and L the mean of the shifts of the patches, weighted by
/// exp(−100 |distance / size of the image|²) (GCorrPatchShift.cu of AreTomo 2 and 3).
LocalPlace place_of_aretomo(std::vector<io::AreTomoPatch> patches, double rotation_deg,
                            double width_px, double height_px);

/// The angles of one view.
struct ViewAngles {
  double tilt_deg = 0.0, x_tilt_deg = 0.0;
};

/// Returns the mean change of the tilt angle over the parts of IMOD's local alignments.
double mean_tilt_change_deg(const io::ImodLocal& local, std::int64_t section);

/// Returns the places of IMOD's local alignments of a section: of points halfway up the specimen,
/// whose global projection with `angles` is the aligned place. `stated` are the angles of the
/// files, to which those of the parts are added. A point is projected by the parts around its X and
/// Y, each with its own angles and transform, and the projections are interpolated linearly
/// (localProjFactors of tilt.f90). The aligned view has this size, and its pixels are `scale` times
/// smaller than those of `local`.
LocalPlace place_of_imod(const io::ImodLocal& local, std::int64_t section, const ViewAngles& stated,
                         const ViewAngles& angles, double width_px, double height_px, double scale);

}  // namespace tomofield::tilt_series
