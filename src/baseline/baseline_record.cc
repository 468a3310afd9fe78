#include "baseline/baseline_record.h"

#include <fmt/format.h>

#include <vector>

#include "base/enum_names.h"
#include "base/threads/parallel.h"
#include "io/json.h"
#include "option_table/setting.h"
#include "option_table/values.h"
#include "output/metrics_record.h"
#include "tune/trial_record.h"

namespace tomofield::baseline {
namespace {

using nlohmann::json;

json fields_of(const WbpOptions& o) {
  return {{"window", base::name_of(o.filter.window)},
          {"cutoff", o.filter.cutoff},
          {"falloff", o.filter.falloff}};
}

json fields_of(const SirtOptions& o) {
  return {
      {"iterations", o.iterations}, {"relaxation", o.relaxation}, {"non_negative", o.non_negative}};
}

json fields_of(const SartTvOptions& o) {
  return {{"iterations", o.iterations}, {"subsets", o.subsets}, {"relaxation", o.relaxation},
          {"tv_steps", o.tv_steps},     {"weight", o.weight},   {"non_negative", o.non_negative}};
}

json fields_of(const TvOptions& o) {
  return {{"iterations", o.iterations},
          {"weight", o.weight.value_or(o.usual_weight())},
          {"penalty", base::name_of(o.penalty.value_or(Penalty::kSmooth))},
          {"concavity", o.concavity},
          {"non_negative", o.non_negative}};
}

json fields_of(const NetworkOptions& o) {
  return {
      {"iterations", o.iterations},       {"hidden_layers", o.hidden_layers}, {"width", o.width},
      {"learning_rate", o.learning_rate}, {"non_negative", o.non_negative},   {"seed", o.seed}};
}

json fields_of(const IngpOptions& o) {
  json fields = fields_of(static_cast<const NetworkOptions&>(o));
  fields.update({{"levels", o.grid.levels},
                 {"coarsest", o.grid.coarsest},
                 {"finest", o.grid.finest},
                 {"table_bits", o.grid.table_bits}});
  return fields;
}

json fields_of(const FourierNetOptions& o) {
  json fields = fields_of(static_cast<const NetworkOptions&>(o));
  fields["features"] = o.features;
  fields["shortest"] = o.shortest;
  return fields;
}

json metrics_json(const BaselineRecord& record) {
  const auto& [options, series, problem, solution, num_parameters, seconds, tuned, held_out] =
      record;
  json views = json::array();
  for (const int view : problem.views()) {
    const std::size_t v = static_cast<std::size_t>(view);
    views.push_back({{"tilt_deg", series.geometry.tilt_deg[v]},
                     {"scale", problem.view_model(view).scale},
                     {"offset", problem.view_model(view).offset * series.unit},
                     {"noise_sigma", series.noise_sigma[v] * series.unit}});
  }
  for (std::size_t i = 0; i < solution.noise_sigma.size(); ++i)
    views[i]["learned_noise_sigma"] = solution.noise_sigma[i] * series.unit;
  std::vector<double> residuals;
  for (const double loss : solution.data_loss)
    residuals.push_back(2 * loss / static_cast<double>(problem.num_rays()));
  return {{"parameters", num_parameters},
          {"mean_squared_residual_per_noise_variance", residuals},
          {"objective", solution.objective},
          {"density_unit", series.unit},
          {"pixel_size_A", series.pixel_size_A},
          {"size_px", {series.roi.width(), series.roi.height(), series.geometry.thickness}},
          {"seconds", seconds},
          {"threads", base::thread_count()},
          {"threads_why", base::describe_threads()},
          {"mask", output::mask_json(series)},
          {"views", views},
          {"held_out",
           held_out ? output::report_held_out(*held_out, series.geometry.tilt_deg) : json(nullptr)},
          {"tuning", tuned ? tune::tuned_json(*tuned, json_of) : json(nullptr)}};
}

}  // namespace

void write_record(const std::filesystem::path& file, const BaselineRecord& record) {
  io::write_json(file, {{"tomofield", TOMOFIELD_VERSION},
                        {"options", options_json(record.options)},
                        {"origins", option_table::settings_json(record.options.shared.settings)},
                        {"metrics", metrics_json(record)}});
}

json json_of(const Method& method) {
  json fields = std::visit([](const auto& options) { return fields_of(options); }, method);
  fields["name"] = facts_of(method).name;
  return fields;
}

std::string settings_text(const Method& method) {
  const json fields = json_of(method);
  std::string text;
  for (const char* key : {"penalty", "weight", "iterations", "cutoff"}) {
    if (!fields.contains(key)) continue;
    const json& value = fields[key];
    text += fmt::format(
        " --{} {}", key,
        value.is_string() ? value.get<std::string>() : fmt::format("{:.4g}", value.get<double>()));
  }
  return text;
}

json options_json(const BaselineOptions& options) {
  const Options& shared = options.shared;
  const json all = option_table::to_json({options.files, shared});
  return {{"input", all["input"]},
          {"ctf_correction", base::name_of(options.ctf_correction)},
          {"specimen", all["specimen"]},
          {"with_margin", shared.field.with_margin},
          {"margin_spacing", shared.field.margin_spacing},
          {"fit_view_scale", options.fits_view_scale()},
          {"hold_out", shared.fit.hold_out},
          {"tune", shared.fit.tune},
          {"method", json_of(options.method)}};
}

}  // namespace tomofield::baseline
