#include "reconstruct/shared_views.h"

#include <fmt/format.h>

#include <numeric>

#include "base/log.h"
#include "base/stopwatch.h"
#include "base/trace.h"
#include "fit/fit.h"
#include "selection/trial_measurement.h"

namespace tomofield::reconstruction {

std::optional<std::vector<measurement::ViewModel>> find_shared_views(const Run& run) {
  const fit::FitOptions& options = run.options.fit;
  if (!options.fit_view_scale && !options.fit_noise) return std::vector<measurement::ViewModel>();
  const base::TraceSpan span("find shared views");
  std::vector<int> views(static_cast<std::size_t>(run.measurement.geometry.num_views()));
  std::iota(views.begin(), views.end(), 0);
  const measurement::Measurement middle =
      middle_rows(run.measurement, selection::kTrialRows, views, run.processes);
  base::log_info(
      fmt::format("the halves share the scales and weights of views from a fit of {} "
                  "rows in the middle of all views",
                  middle.roi.height()));
  fit::Fit fit(middle, run.options.field, options);  // the same on every process
  const base::Stopwatch running;
  bool was_stopped = false;
  fit.run([&](const fit::Fit&) {
    if (run.hooks.tune_progress)
      run.hooks.tune_progress(
          base::progress_at(fit.work(fit.progress().step) / fit.work(fit.num_steps()),
                            running.seconds(), "scales and weights of views"));
    const bool stop = run.hooks.stop_requested && run.hooks.stop_requested() && !fit.is_done();
    was_stopped = run.processes.allreduce_max(stop ? 1.0 : 0.0) > 0;
    return !was_stopped;
  });
  if (was_stopped) return std::nullopt;
  return fit.progress().views;
}

}  // namespace tomofield::reconstruction
