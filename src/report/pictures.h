#pragma once

#include <filesystem>
#include <vector>

#include "evaluate/resolution/fsc.h"
#include "measurement/held_out.h"
#include "output/model_file.h"
#include "output/output_paths.h"
#include "report/curve_plot.h"
#include "tilt_series/tilt_series.h"
#include "tune/trial_settings.h"

namespace tomofield::report {

/// Draws the view of lowest tilt with its masked pixels in red, so that one look tells whether
/// beads and fill were found. Beads of a bright series that were undecided are red if
/// `bead_masking` says that they were masked, else blue. Dense parts are dark; y runs upwards.
/// Small views are enlarged by whole pixels. Replaces the file.
void write_mask_picture(const tilt_series::TiltSeries& series,
                        tilt_series::BeadMasking bead_masking, const std::filesystem::path& path);

/// Draws the central slices of a volume (slice.h) and the masks of its series
/// (write_mask_picture()): OutputPaths::pictures().
void write_run_pictures(const std::filesystem::path& volume, const tilt_series::TiltSeries& series,
                        tilt_series::BeadMasking bead_masking, const output::OutputPaths& paths);

/// Draws the leaves of a model: the central XY slice of its region of interest in grey (x to the
/// right, y upwards; greys as in write_slice_pictures(), densities as the model holds them), with
/// the borders of the leaves over it in orange. The picture is enlarged by whole pixels. A border
/// is one picture pixel wide, on the inner side of a leaf's lower x and y faces. Replaces `path`.
/// Throws Error if it cannot be written.
void write_tree_picture(const output::Model& model, const std::filesystem::path& path);

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

/// Writes a picture (PNG) of a held-out view. Three panels lie side by side: the measured view, the
/// predicted view and the residual (measured − predicted). They share one grey scale: black to
/// white spans the middle 99 % of the measured values. The scale is shifted for the residual, so
/// that zero is the middle grey. Pixels that are not measurements are black. Throws Error if `path`
/// cannot be written.
void write_held_out_picture(const measurement::PredictedView& view,
                            const std::filesystem::path& path);

/// Draws what the learned prior changes: a section of the trial without it, of the trial with it,
/// and their difference (trial_sections.h). Removes the file and draws nothing if the trials have
/// no sections, as those that a resumed run reads.
void write_prior_picture(const tune::TunedFit& tuned, double output_scale,
                         const std::filesystem::path& path);

}  // namespace tomofield::report
