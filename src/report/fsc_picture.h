#pragma once

#include <filesystem>

#include "evaluate/fsc.h"
#include "report/curve_plot.h"

namespace tomofield::report {

/// Axes of shell correlations over frequency, in 1/Å up to `highest`, labelled with resolutions:
/// lines at 0, 0.143, 0.5 and 1.
PlotAxes fsc_axes(double highest_frequency_per_A);

/// A correlation at each of these frequencies.
Curve fsc_curve(std::string name, const std::vector<double>& frequency_per_A,
                const std::vector<double>& correlation);

/// A plot of the shell correlation (curve_plot.h): all Fourier voxels and, if they are told apart,
/// those within the tilt range and those of the missing wedge. Replaces `path`. Throws Error.
void write_fsc_picture(const evaluate::Fsc& fsc, const std::filesystem::path& path);

}  // namespace tomofield::report
