#include "output/metrics_record.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <span>
#include <vector>

#include "base/enum_names.h"
#include "base/log.h"
#include "base/threads/parallel.h"

namespace tomofield::output {
namespace {

// Returns the history of an adaptive tree as JSON.
nlohmann::json tree_json(const fit::TreeProgress& tree) {
  nlohmann::json updates = nlohmann::json::array();
  for (const fit::TreeUpdate& u : tree.updates) {
    updates.push_back({{"epoch", u.epoch},
                       {"splits", u.splits},
                       {"merges", u.merges},
                       {"error", u.error},
                       {"predicted_error", u.predicted_error},
                       {"leaves_by_level", u.leaves_by_level}});
  }
  return updates;
}

// Returns the residual of a view in the last epoch, or null for a view that was not fitted.
nlohmann::json residual_json(const fit::Progress& progress, std::size_t view) {
  if (progress.view_residual.empty() || progress.view_residual[view] == 0.0) return nullptr;
  return progress.view_residual[view];
}

nlohmann::json stages_json(const std::vector<fit::Stage>& stages) {
  nlohmann::json list = nlohmann::json::array();
  for (const fit::Stage& s : stages)
    list.push_back({{"field", base::name_of(s.field_kind)},
                    {"bin", s.bin},
                    {"first_epoch", s.first_epoch},
                    {"epochs", s.epochs}});
  return list;
}

}  // namespace

nlohmann::json mask_json(const measurement::Measurement& series) {
  const tilt_series::MaskMetrics& masks = series.masks;
  nlohmann::json views = nlohmann::json::array();
  const int num_views = series.geometry.num_views();
  double masked_part = 0;
  for (int v = 0; v < num_views; ++v) {
    const auto view = static_cast<std::size_t>(v);
    masked_part += series.masked_part[view] / num_views;
    views.push_back({{"tilt_deg", series.geometry.tilt_deg[view]},
                     {"beads_found", masks.beads_found[view]},
                     {"beads_masked", masks.beads_masked[view]},
                     {"masked_part", series.masked_part[view]}});
  }
  return {{"beads", masks.num_beads},
          {"bead_diameter_nm", masks.bead_diameter_A / 10},
          {"bead_masking", base::name_of(masks.bead_masking)},
          {"bad_pixels", masks.num_bad_pixels},
          {"fixed_pattern",
           {{"column_deviation", masks.fixed_pattern.column_deviation},
            {"row_deviation", masks.fixed_pattern.row_deviation},
            {"pixels", masks.fixed_pattern.num_pixels}}},
          {"masked_part", masked_part},
          {"views", views}};
}

nlohmann::json metrics_json(const fit::Fit& fit, const measurement::Measurement& series,
                            double seconds) {
  const fit::Progress& progress = fit.progress();
  nlohmann::json views = nlohmann::json::array();
  for (std::size_t v = 0; v < progress.views.size(); ++v) {
    views.push_back({{"tilt_deg", series.geometry.tilt_deg[v]},
                     {"scale", progress.views[v].scale},
                     {"offset", progress.views[v].offset * series.unit},
                     {"noise_sigma", series.noise_sigma[v] * series.unit},
                     {"residual", residual_json(progress, v)},
                     {"weight", progress.views[v].weight * std::pow(series.noise_sigma[v], 2)}});
  }
  return {{"parameters", fit.field().num_parameters()},
          {"leaves", fit.field().tree().num_leaves()},
          {"tree_updates", tree_json(progress.tree)},
          {"steps", progress.step},
          {"mean_squared_residual_per_noise_variance", progress.data_loss},
          {"density_unit", series.unit},
          {"tv_gain", fit.variation_gain()},
          {"pixel_size_A", series.pixel_size_A},
          {"size_px", {series.roi.width(), series.roi.height(), series.geometry.thickness}},
          {"stages", stages_json(fit.stages())},
          {"seconds", seconds},
          {"threads", base::thread_count()},
          {"threads_why", base::describe_threads()},
          {"mask", mask_json(series)},
          {"views", views}};
}

nlohmann::json report_held_out(const measurement::ViewErrors& error,
                               const std::vector<double>& tilt_deg, bool stopped_by_them) {
  base::log_info(fmt::format(
      "held out: {} views, error {:.4f}{}", error.views.size(), error.total,
      stopped_by_them ? " (they also chose when to stop, so others are predicted less well)" : ""));
  nlohmann::json views = nlohmann::json::array();
  for (std::size_t i = 0; i < error.views.size(); ++i) {
    const auto view = static_cast<std::size_t>(error.views[i]);
    views.push_back({{"view", view}, {"tilt_deg", tilt_deg[view]}, {"error", error.view_error[i]}});
  }
  return {{"error", error.total}, {"independent", !stopped_by_them}, {"views", views}};
}

nlohmann::json compact_json(const compact::CompressionReport& report, double seconds) {
  return {{"parameters", report.parameters},
          {"bytes", report.bytes},
          {"rms_change_over_deviation", std::sqrt(report.mean_square_change / report.variance)},
          {"decibels", report.decibels},
          {"seconds", seconds}};
}

// Returns the rows whose slabs this process works on at full resolution.
std::int64_t rows_worked_on(const fit::Fit& fit) {
  const measurement::RowShare& share = fit.share();
  const std::int64_t band = fit.field().tree().roots().cell_size;
  const std::int64_t first = share.bands.begin * band + share.rows_by_previous;
  return std::min(share.bands.end * band + share.rows_for_next, fit.num_rows()) - first;
}

nlohmann::json processes_json(const fit::Fit& fit, double seconds) {
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
  nlohmann::json list = nlohmann::json::array();
  for (auto p = all.begin(); p != all.end(); p += kNumbers) {
    list.push_back({{"bands", std::lround(p[0])},
                    {"rows", std::lround(p[1])},
                    {"leaves", std::lround(p[2])},
                    {"seconds_computing", p[3]},
                    {"seconds_communicating", p[4]},
                    {"bytes_sent_per_step", p[5]}});
  }
  return list;
}

}  // namespace tomofield::output
