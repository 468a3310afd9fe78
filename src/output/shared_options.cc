#include "output/shared_options.h"

#include "io/saving/scratch_memory.h"

namespace tomofield::output {

tilt_series::TiltSeriesOptions series_options(const SeriesFiles& files, const Options& options) {
  tilt_series::TiltSeriesOptions series{files, options.views};
  series.resample = options.fit.engine == Engine::kSlab;
  series.starts_raw = options.run.align == Alignment::kFull;
  series.applies_local = series.resample && options.run.align == Alignment::kOff;
  series.scratch_dir = io::scratch_directory(options.run.output);
  return series;
}

ModelInfo model_info(const measurement::Measurement& series, Contrast contrast) {
  ModelInfo info;
  info.geometry = series.geometry;
  info.roi = series.roi;
  info.x_tilt_deg = series.x_tilt_deg;
  info.pixel_size_A = series.pixel_size_A;
  info.density_unit = series.unit;
  info.is_dark = contrast == Contrast::kDark;
  return info;
}

}  // namespace tomofield::output
