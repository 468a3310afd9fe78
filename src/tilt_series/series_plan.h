#pragma once

#include <array>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "geometry/view_correction.h"
#include "io/images/image_stack.h"
#include "tilt_series/resampling/align_image.h"
#include "tomofield/options.h"

namespace tomofield::tilt_series {

/// The files of a tilt series, how they are read, and what the program adds to that.
struct TiltSeriesOptions : SeriesFiles, ViewOptions {
  std::shared_ptr<const io::ImageStack> images = {};  ///< views in memory, in place of `stack`
  bool resample = true;  ///< false: views stay as they were recorded, with their alignment beside
  /// The views will be aligned from the direction of their tilt axis on, as files state it. Else a
  /// stack whose stated axis is not vertical needs an alignment.
  bool starts_raw = false;
  /// False: local alignments of files are left out, as for views that will be aligned.
  bool applies_local = true;
  /// The size of a pixel that the files of a project state (project_pixel_size_A()).
  std::optional<double> listed_pixel_size_A = {};
  /// Takes decoded views that do not fit in memory; empty: the system's folder for such files.
  std::filesystem::path scratch_dir = {};
  /// [section]: changes of the alignment that the files give. Empty: none. Local motion
  /// needs `resample`.
  std::vector<geometry::ViewCorrection> corrections = {};
  /// Sections that are left out beside `exclude`, counted from 0, ascending.
  std::vector<std::int64_t> left_out = {};
};

/// Returns the size of a pixel that the files of a project state, also if another one is given.
std::optional<double> project_pixel_size_A(std::span<const Setting> settings);

/// Returns how a tilt series is read. Views stay as they were recorded for the ray engine. Scratch
/// files go beside the output, if there is one.
TiltSeriesOptions series_options(const SeriesFiles& files, const Options& options);

/// One view of the series.
struct View {
  std::int64_t section = 0;  ///< zero-based section of the stack
  double tilt_deg = 0.0;     ///< rotation about +Y
  double x_tilt_deg = 0.0;   ///< rotation about +X, before the tilt
};

/// The direction of the tilt axis in the images of a stack, and what states it.
struct StatedAxis {
  double angle_deg = 0.0;  ///< counter-clockwise from +Y, from −180 to 180
  std::string source;      ///< for messages: "'TS_01.mdoc', line 9"
  bool is_given = false;   ///< by the user with --tilt-axis
};

/// A view that is kept, and how its aligned image comes from its section.
struct PlannedView {
  View view;
  RawFromAligned raw_from_aligned;
  std::optional<geometry::ViewWarp> local{};  ///< local motion in the aligned view, unbinned
};

/// A series as the small files and the stack's header describe it, before any pixel is read.
struct SeriesPlan {
  std::vector<PlannedView> views;  ///< in the stack's order
  bool is_raw = false;             ///< the files align a raw stack; else it is aligned already
  std::int64_t aligned_width = 0;  ///< unbinned pixels
  std::int64_t aligned_height = 0;
  double pixel_size_A = 1.0;         ///< of an unbinned pixel
  double listed_pixel_size_A = 1.0;  ///< of the pixels by which a table states shifts in Å
  double bin_factor = 1.0;
  std::string angle_source;        ///< for messages: a file name, or the stack's header
  std::optional<StatedAxis> axis;  ///< by which views are turned, if no alignment is given
};

/// Returns the width and the height that IMOD's transforms give the aligned views, in unbinned
/// pixels: those of the stack, exchanged if the tilt axis is nearer to X than to Y.
std::array<std::int64_t, 2> aligned_size(const std::filesystem::path& xf,
                                         const io::ImageStack& stack);

/// Returns the mean tilt axis that IMOD's transforms undo, counter-clockwise from +Y.
double axis_of_transforms(const std::filesystem::path& xf, const io::ImageStack& stack);

/// Brings the options, the files that they name and the stack together.
/// Throws Error where they do not fit each other or cannot be right.
SeriesPlan plan_series(const TiltSeriesOptions& options, const io::ImageStack& stack);

}  // namespace tomofield::tilt_series
