#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <vector>

#include "geometry/raw_from_aligned.h"
#include "tilt_series/planned_series.h"
#include "tomofield/options.h"

namespace tomofield::output {

/// The paths of the files of an alignment.
struct AlignmentFiles {
  std::filesystem::path xf, tlt, xtilt, aln;

  std::vector<std::filesystem::path> all() const { return {xf, tlt, xtilt, aln}; }
};

/// Returns the names PREFIX.xf, PREFIX.tlt, PREFIX.xtilt and PREFIX.aln.
AlignmentFiles alignment_files(const std::filesystem::path& prefix);

/// Where the tilt axis is, in pixels before binning.
struct TiltAxis {
  double from_middle_px;  ///< to the right of the middle of the aligned views
  double height_px;       ///< above the lower face of the field
  double thickness_px;    ///< of the field: that of SpecimenOptions in whole binned pixels
};

/// Returns the tilt axis of a fit to this series.
TiltAxis tilt_axis(const tilt_series::PlannedSeries& series, const SpecimenOptions& specimen);

/// Returns the map of a view in pixels before binning, for places that count from the tilt axis.
geometry::RawFromAligned map_from_axis(const tilt_series::PlannedSeries& series, std::size_t view,
                                       double axis_from_middle_px);

/// Writes how a series is aligned, as IMOD and AreTomo have it (docs/geometry.md). `raw_size` are
/// the width and the height of the recorded views before binning, in pixels, and the number of
/// sections of the stack. Replaces the files. Throws Error if one cannot be written.
///
/// - The .tlt, the .xtilt and the .xf have a line for every section of the stack. The line of a
///   section that is left out has the mean rotation of the views, no shift, and angles on a
///   straight line through those of the nearest views. Shifts are in pixels before binning.
/// - The .xtilt is written if a view has an x-axis tilt. Otherwise an old one is removed when the
///   results are committed (io/saving/output_set.h). It belongs to the .xf as well as to the .aln,
///   which has no x-axis tilts.
/// - The .aln counts sections from 1. A section that is left out is a dark frame. The format has a
///   rotation and a shift for each view: AreTomo applies no magnification (GMAG is 1), and neither
///   does the reader of this program. So a view has the rotation that is nearest to its matrix. If
///   this moves a corner of a view by more than 0.1 pixels before binning, a warning says how far.
///   There is no .aln of mirrored views, and a warning says so.
///
/// The angles include --tilt-offset and --x-axis-tilt, and the shifts the place of the tilt axis
/// (TiltAxis), so that it is in the middle: these are not to be applied again.
void write_alignment_files(const tilt_series::PlannedSeries& series,
                           const std::array<std::int64_t, 3>& raw_size, const AlignmentFiles& files,
                           double axis_from_middle_px = 0.0);

}  // namespace tomofield::output
