#include "reconstruct/half_measurement.h"

#include "base/trace.h"
#include "fit/domain.h"
#include "io/saving/scratch_memory.h"

namespace tomofield::reconstruction {

measurement::Measurement half_measurement(const tilt_series::TiltSeries& series,
                                          tilt_series::Half half, const Run& run) {
  const base::TraceSpan span("prepare half");
  if (run.options.resolved.split_tilts) return measurement::half_of_tilts(half, run.measurement);
  return measurement::half_of_frames(series, half, run.measurement,
                                     io::scratch_directory(run.options.resolved.output),
                                     fit::band_rows(run.options.field), run.processes);
}

std::vector<measurement::ViewModel> views_of_half(const std::vector<measurement::ViewModel>& views,
                                                  const Run& run) {
  if (run.options.resolved.split_tilts) return views;
  return measurement::with_noise_of_half_frames(views);
}

}  // namespace tomofield::reconstruction
