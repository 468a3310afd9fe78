#pragma once

#include <filesystem>
#include <vector>

#include "align/alignment_record.h"
#include "report/curve_plot.h"

namespace tomofield::report {

/// The changes of an alignment in each view, and how well the view agrees with its projection then.
/// Each vector has one number for each view, in any order of tilt. Tilts are finite. Another number
/// that is not finite is not drawn.
struct AlignmentCurves {
  std::vector<double> tilt_deg;
  // The change from the alignment that was given to the one that was found. Shifts are in pixels
  // before binning: x across the tilt axis and y along it.
  std::vector<double> shift_x_px, shift_y_px;
  std::vector<double> rotation_deg, magnification_percent, tilt_change_deg;
  std::vector<double> local_px;     ///< root mean square of the nodes of the local motion
  std::vector<double> correlation;  ///< of the view with its projection
  std::vector<double> error_x_px, error_y_px;  ///< standard errors of the shift
};

/// Returns the curves of an alignment.
AlignmentCurves alignment_curves(const alignment::AlignmentRecord& record);

/// Returns plots over the tilt: shift, rotation, magnification, tilt angle, local motion,
/// correlation, and standard error of the shift. A rotation, a magnification, a change of the tilt
/// angle or local motion that no view has is left out.
std::vector<CurvePlot> alignment_plots(const AlignmentCurves& alignment);

/// Draws these plots one below the other as a PNG. Replaces `path`. Throws Error if it cannot be
/// written.
void write_alignment_picture(const AlignmentCurves& alignment, const std::filesystem::path& path);

}  // namespace tomofield::report
