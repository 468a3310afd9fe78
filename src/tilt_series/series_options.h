#pragma once

#include <cstdint>
#include <filesystem>
#include <memory>
#include <vector>

#include "geometry/view_correction.h"
#include "io/images/image_stack.h"
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
  /// Takes decoded views that do not fit in memory; empty: the system's folder for such files.
  std::filesystem::path scratch_dir = {};
  /// [section]: changes of the alignment that the files give. Empty: none. Local motion
  /// needs `resample`.
  std::vector<geometry::ViewCorrection> corrections = {};
  /// Sections that are left out beside `exclude`, counted from 0, ascending.
  std::vector<std::int64_t> left_out = {};
};

}  // namespace tomofield::tilt_series
