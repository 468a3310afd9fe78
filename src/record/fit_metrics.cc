#include "record/fit_metrics.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <span>

#include "base/threads/parallel.h"

namespace tomofield::record {
namespace {

// Returns the residual of a view in the last epoch, or nothing for a view that was not fitted.
std::optional<double> residual_of(const fit::Progress& progress, std::size_t view) {
  if (progress.view_residual.empty() || progress.view_residual[view] == 0.0) return std::nullopt;
  return progress.view_residual[view];
}

std::vector<ViewMetrics> view_metrics(const fit::Progress& progress,
                                      const measurement::Measurement& series) {
  std::vector<ViewMetrics> views;
  for (std::size_t v = 0; v < progress.views.size(); ++v)
    views.push_back({.tilt_deg = series.geometry.tilt_deg[v],
                     .scale = progress.views[v].scale,
                     .offset = progress.views[v].offset * series.unit,
                     .noise_sigma = series.noise_sigma[v] * series.unit,
                     .residual = residual_of(progress, v),
                     .weight = progress.views[v].weight * std::pow(series.noise_sigma[v], 2)});
  return views;
}

// Returns the rows whose slabs this process works on at full resolution.
std::int64_t rows_worked_on(const fit::Fit& fit) {
  const measurement::RowShare& share = fit.share();
  const std::int64_t band = fit.field().tree().roots().cell_size;
  const std::int64_t first = share.bands.begin * band + share.rows_by_previous;
  return std::min(share.bands.end * band + share.rows_for_next, fit.num_rows()) - first;
}

std::vector<ProcessMetrics> process_metrics(const fit::Fit& fit, double seconds) {
  const distributed::Communicator& processes = fit.processes();
  const fit::Fit::Traffic traffic = fit.traffic();
  constexpr std::size_t kNumbers = 6;
  std::vector<double> all(kNumbers * static_cast<std::size_t>(processes.size()));
  const auto own = all.begin() + static_cast<std::ptrdiff_t>(kNumbers) * processes.rank();
  const double steps = static_cast<double>(std::max<std::int64_t>(traffic.steps, 1));
  std::ranges::copy(std::array<double, kNumbers>{static_cast<double>(fit.share().bands.size()),
                                                 static_cast<double>(rows_worked_on(fit)),
                                                 static_cast<double>(fit.own_leaves().size()),
                                                 seconds - traffic.seconds, traffic.seconds,
                                                 static_cast<double>(traffic.bytes) / steps},
                    own);
  processes.allreduce_sum(std::span(all));
  std::vector<ProcessMetrics> list;
  for (auto p = all.begin(); p != all.end(); p += kNumbers)
    list.push_back({std::lround(p[0]), std::lround(p[1]), std::lround(p[2]), p[3], p[4], p[5]});
  return list;
}

}  // namespace

FitMetrics fit_metrics(const fit::Fit& fit, const measurement::Measurement& series,
                       double tv_weight, double seconds) {
  const fit::Progress& progress = fit.progress();
  return {.num_parameters = fit.field().num_parameters(),
          .num_leaves = fit.field().tree().num_leaves(),
          .tree_updates = progress.tree.updates,
          .steps = progress.step,
          .data_loss = progress.data_loss,
          .density_unit = series.unit,
          .tv_gain = fit.variation_gain(),
          .tv_weight = tv_weight,
          .pixel_size_A = series.pixel_size_A,
          .width = series.roi.width(),
          .height = series.roi.height(),
          .thickness = series.geometry.thickness,
          .stages = fit.stages(),
          .seconds = seconds,
          .threads = base::thread_count(),
          .threads_why = base::describe_threads(),
          .mask = output::masked_views(series),
          .views = view_metrics(progress, series),
          .held_out = {},
          .processes = process_metrics(fit, seconds)};
}

}  // namespace tomofield::record
