#pragma once

#include <filesystem>

#include "evaluate/fsc.h"
#include "report/curve_plot.h"

namespace tomofield::report {

/// Returns the axes of shell correlations over frequency, in 1/Å up to `highest_frequency_per_A`,
/// labelled with resolutions. There are lines at 0, 0.143, 0.5 and 1.
PlotAxes fsc_axes(double highest_frequency_per_A);

/// Returns the curve of the correlation at each of these frequencies.
Curve fsc_curve(std::string name, const std::vector<double>& frequency_per_A,
                const std::vector<double>& correlation);

/// Draws the shell correlation (curve_plot.h): all Fourier voxels and, if the correlation has them,
/// those inside the tilt range and those of the missing wedge. Replaces `path`. Throws Error if it
/// cannot be written.
void write_fsc_picture(const evaluate::Fsc& fsc, const std::filesystem::path& path);

}  // namespace tomofield::report
