#include "record/run_record.h"

#include "base/enum_names.h"
#include "base/utf8.h"
#include "evaluate/evaluation_record.h"
#include "evaluate/resolution/local_resolution.h"
#include "evaluate/uncertainty.h"
#include "io/json.h"
#include "tune/trial_record.h"
#include "verdict/verdict_record.h"

namespace tomofield::record {
namespace {

using nlohmann::json;

json text(const std::filesystem::path& path) { return base::utf8_text(path.string()); }

// Returns the history of an adaptive tree.
json tree_json(const std::vector<fit::TreeUpdate>& tree_updates) {
  json updates = json::array();
  for (const fit::TreeUpdate& u : tree_updates) {
    updates.push_back({{"epoch", u.epoch},
                       {"splits", u.splits},
                       {"merges", u.merges},
                       {"error", u.error},
                       {"predicted_error", u.predicted_error},
                       {"leaves_by_level", u.leaves_by_level}});
  }
  return updates;
}

json stages_json(const std::vector<fit::Stage>& stages) {
  json list = json::array();
  for (const fit::Stage& s : stages)
    list.push_back({{"field", base::name_of(s.field_kind)},
                    {"bin", s.bin},
                    {"first_epoch", s.first_epoch},
                    {"epochs", s.epochs}});
  return list;
}

json views_json(const std::vector<ViewMetrics>& views) {
  json list = json::array();
  for (const ViewMetrics& view : views)
    list.push_back({{"tilt_deg", view.tilt_deg},
                    {"scale", view.scale},
                    {"offset", view.offset},
                    {"noise_sigma", view.noise_sigma},
                    {"residual", view.residual ? json(*view.residual) : json(nullptr)},
                    {"weight", view.weight}});
  return list;
}

json processes_json(const std::vector<ProcessMetrics>& processes) {
  json list = json::array();
  for (const ProcessMetrics& p : processes)
    list.push_back({{"bands", p.bands},
                    {"rows", p.rows},
                    {"leaves", p.leaves},
                    {"seconds_computing", p.seconds_computing},
                    {"seconds_communicating", p.seconds_communicating},
                    {"bytes_sent_per_step", p.bytes_sent_per_step}});
  return list;
}

json held_out_json(const FitMetrics& metrics) {
  if (!metrics.held_out) return nullptr;
  const HeldOutMetrics& held_out = *metrics.held_out;
  std::vector<double> tilt_deg;
  for (const ViewMetrics& view : metrics.views) tilt_deg.push_back(view.tilt_deg);
  json object = output::held_out_json(held_out.errors, tilt_deg, held_out.has_stopped_fit);
  object["error_by_epoch"] = held_out.error_by_epoch;
  return object;
}

json fit_json(const FitRecord& fit) {
  const FitMetrics& m = fit.metrics;
  json object = {{"parameters", m.num_parameters},
                 {"leaves", m.num_leaves},
                 {"tree_updates", tree_json(m.tree_updates)},
                 {"steps", m.steps},
                 {"mean_squared_residual_per_noise_variance", m.data_loss},
                 {"density_unit", m.density_unit},
                 {"tv_gain", m.tv_gain},
                 {"tv_weight", m.tv_weight},
                 {"pixel_size_A", m.pixel_size_A},
                 {"size_px", {m.width, m.height, m.thickness}},
                 {"stages", stages_json(m.stages)},
                 {"seconds", m.seconds},
                 {"threads", m.threads},
                 {"threads_why", m.threads_why},
                 {"mask", output::mask_json(m.mask)},
                 {"views", views_json(m.views)},
                 {"held_out", held_out_json(m)},
                 {"processes", processes_json(m.processes)},
                 {"verdict", verdict::verdict_json(fit.verdict)}};
  object.update(
      evaluate::artefacts_json(fit.verdict.artefacts.speckle, fit.verdict.artefacts.faces));
  object["alignment"] = fit.alignment ? alignment::to_json(*fit.alignment) : json(nullptr);
  object["tuning"] = fit.tuned ? tune::tuning_json(*fit.tuned) : json(nullptr);
  return object;
}

json metrics_json(const RunRecord& record) {
  json metrics = fit_json(record.fit);
  if (record.tiles) {
    metrics["example_tile"] = {record.tiles->example.begin, record.tiles->example.end};
    metrics["tiles"] = checkpoint::to_json(record.tiles->tiles);
  }
  if (record.compact)
    metrics["compact"] = output::compact_json(record.compact->report, record.compact->seconds);
  return metrics;
}

json half_json(const HalvesRecord::OfHalf& half) {
  return {
      {"volume", text(half.volume)}, {"model", text(half.model)}, {"metrics", fit_json(half.fit)}};
}

json fsc_json(const FscRecord& record) { return evaluate::fsc_json(record.fsc, record.files); }

json halves_json(const HalvesRecord& record) {
  json object = {
      {"of", record.are_of_tilts ? "tilts" : "frames"},
      {"even", half_json(record.halves[0])},
      {"odd", half_json(record.halves[1])},
      {"fsc", fsc_json(record.fsc)},
      {"local_resolution",
       {{"file", text(record.local_resolution)},
        {"window_px", evaluate::kResolutionWindow},
        {"threshold", evaluate::kLocalThreshold},
        {"median_A", record.median_A},
        {"finest_tenth_A", record.finest_tenth_A},
        {"coarsest_tenth_A", record.coarsest_tenth_A}}},
      {"uncertainty", {{"file", text(record.uncertainty)}, {"box_px", evaluate::kUncertaintyBox}}}};
  if (record.linear)
    object["linear"] = {{"even", text(record.linear->files.first)},
                        {"odd", text(record.linear->files.second)},
                        {"fsc", fsc_json(*record.linear)}};
  return object;
}

}  // namespace

std::string text_of(const RunRecord& record) {
  json object = {{"tomofield", TOMOFIELD_VERSION},
                 {"options", record.options},
                 {"origins", option_table::settings_json(record.settings)},
                 {"metrics", metrics_json(record)}};
  if (record.halves) object["halves"] = halves_json(*record.halves);
  return io::json_text(object);
}

void write_record(const std::filesystem::path& file, const RunRecord& record) {
  io::write_text_file(file, text_of(record));
}

}  // namespace tomofield::record
