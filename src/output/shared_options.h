#pragma once

#include "measurement/measurement.h"
#include "output/model_file.h"
#include "tilt_series/tilt_series.h"
#include "tomofield/options.h"

namespace tomofield::output {

/// Returns how a tilt series is read. Views stay as they were recorded for the ray engine. Scratch
/// files go beside the output, if there is one.
tilt_series::TiltSeriesOptions series_options(const SeriesFiles& files, const Options& options);

/// Returns what densities that were fitted to a measurement mean.
ModelInfo model_info(const measurement::Measurement& series, Contrast contrast);

}  // namespace tomofield::output
