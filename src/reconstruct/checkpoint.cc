#include "reconstruct/checkpoint.h"

#include <fmt/format.h>

#include <algorithm>
#include <map>
#include <nlohmann/json.hpp>
#include <set>
#include <span>
#include <utility>

#include "base/range.h"
#include "base/trace.h"
#include "distributed/gathered_arrays.h"
#include "option_table/rows.h"
#include "tomofield/error.h"

namespace tomofield::reconstruction {
namespace {

// Writes the x-axis tilt, the 2 × 2 matrix and the shift of each view.
nlohmann::json alignment_json(const geometry::RayGeometry& g) {
  nlohmann::json views = nlohmann::json::array();
  for (std::size_t v = 0; v < g.x_tilt_deg.size(); ++v) {
    const geometry::RawFromAligned& m = g.raw_from_aligned[v];
    views.push_back({g.x_tilt_deg[v], m.m11, m.m12, m.m21, m.m22, m.shift_x_px, m.shift_y_px});
  }
  return views;
}

// Writes seven numbers for each view, in the order of the members.
std::vector<double> flatten(const std::vector<measurement::ViewSums>& sums) {
  std::vector<double> flat;
  for (const measurement::ViewSums& s : sums)
    flat.insert(flat.end(), {s.n, s.p, s.b, s.pp, s.pb, s.bb, s.limited_squares});
  return flat;
}

std::vector<measurement::ViewSums> unflatten_sums(const std::vector<double>& flat) {
  std::vector<measurement::ViewSums> sums;
  for (std::size_t i = 0; i + 7 <= flat.size(); i += 7) {
    sums.push_back(
        {flat[i], flat[i + 1], flat[i + 2], flat[i + 3], flat[i + 4], flat[i + 5], flat[i + 6]});
  }
  return sums;
}

std::vector<double> flatten(const std::vector<measurement::ViewModel>& views) {
  std::vector<double> flat;
  for (const measurement::ViewModel& v : views)
    flat.insert(flat.end(), {v.scale, v.offset, v.weight, v.largest_residual});
  return flat;
}

std::vector<measurement::ViewModel> unflatten_views(const std::vector<double>& flat) {
  std::vector<measurement::ViewModel> views;
  for (std::size_t i = 0; i + 4 <= flat.size(); i += 4)
    views.push_back({flat[i], flat[i + 1], flat[i + 2], flat[i + 3]});
  return views;
}

// Stores whether the tree is frozen, then the numbers of each update: epoch, splits, merges, the
// number of levels, and the leaves at each level. The errors of an update are stored as doubles.
void store(const fit::TreeProgress& tree, output::TrainingState& state) {
  auto& numbers = state.integers["tree_updates"];
  auto& errors = state.doubles["tree_errors"];
  numbers.push_back(tree.is_frozen ? 1 : 0);
  for (const fit::TreeUpdate& u : tree.updates) {
    numbers.insert(numbers.end(), {u.epoch, u.splits, u.merges,
                                   static_cast<std::int64_t>(u.leaves_by_level.size())});
    numbers.insert(numbers.end(), u.leaves_by_level.begin(), u.leaves_by_level.end());
    errors.insert(errors.end(), {u.error, u.predicted_error});
  }
}

fit::TreeProgress unflatten_tree(const std::vector<std::int64_t>& numbers,
                                 const std::vector<double>& errors) {
  fit::TreeProgress tree;
  tree.is_frozen = numbers.at(0) != 0;
  for (std::size_t i = 1, e = 0; i < numbers.size(); e += 2) {
    const std::size_t num_levels = static_cast<std::size_t>(numbers.at(i + 3));
    fit::TreeUpdate update{.epoch = numbers.at(i),
                           .splits = numbers.at(i + 1),
                           .merges = numbers.at(i + 2),
                           .error = errors.at(e),
                           .predicted_error = errors.at(e + 1),
                           .leaves_by_level = {}};
    for (std::size_t level = 0; level < num_levels; ++level)
      update.leaves_by_level.push_back(numbers.at(i + 4 + level));
    i += 4 + num_levels;
    tree.updates.push_back(std::move(update));
  }
  return tree;
}

std::vector<std::int64_t> as_numbers(const std::string& text) { return {text.begin(), text.end()}; }
std::string as_text(const std::vector<std::int64_t>& numbers) {
  std::string text;
  for (const std::int64_t number : numbers) text.push_back(static_cast<char>(number));
  return text;
}

// Writes the trials without their times, so that a fit gives the same bytes whenever it is made.
nlohmann::json without_times(const TunedFit& tuned) {
  nlohmann::json json = tuning_json(tuned);
  for (nlohmann::json& trial : json["trials"]) trial.erase("seconds");
  return json;
}

// Returns the name that a user has for an entry of a fingerprint: a flag, or a part of the input.
std::string name_of(const std::string& key) {
  // These entries are no options themselves; an option decides each.
  static const std::map<std::string, std::string> derived{{"field.depth", "field.leaf_size"},
                                                          {"bin_factor", "input.bin"}};
  const auto other = derived.find(key);
  const auto flag = option_table::flag_of(other == derived.end() ? key : other->second);
  if (!flag.empty()) return std::string(flag);
  if (key.starts_with("alignment")) return "the alignment of the views";
  for (const char* of_series : {"rays", "noise_sigma", "unit", "tilt_deg"})
    if (key.starts_with(of_series)) return "the tilt series or how it is read";
  return key;
}

// Names the differences between two fingerprints, as in "--seed, the tilt series or how it is
// read".
std::string differences(const std::string& found, const std::string& wanted) {
  const auto parse = [](const std::string& text) {
    return nlohmann::json::parse(text, nullptr, /*allow_exceptions=*/false);
  };
  std::set<std::string> names;
  for (const nlohmann::json& change : nlohmann::json::diff(parse(found), parse(wanted))) {
    std::string name = change["path"].get<std::string>();
    const std::size_t index = name.find_first_of("0123456789");
    if (index != std::string::npos) name.resize(index);  // the name of an array is enough
    std::ranges::replace(name, '/', '.');
    const std::size_t first = name.find_first_not_of('.');
    if (first == std::string::npos) return "everything";
    names.insert(name_of(name.substr(first, name.find_last_not_of('.') + 1 - first)));
  }
  return fmt::format("{}", fmt::join(names, ", "));
}

template <typename Map>
const typename Map::mapped_type& entry(const Map& map, const char* name, const std::string& path) {
  const auto found = map.find(name);
  if (found == map.end()) {
    throw Error(fmt::format(
        "'{}' holds no optimiser state ('{}' is missing), so it is no checkpoint", path, name));
  }
  return found->second;
}

// Prepares to gather arrays with one number for each parameter from the leaves of all processes.
distributed::GatheredArrays own_parts(const fit::Fit& fit) {
  const base::Range leaves = fit.own_leaves();
  return {fit.processes(), fit.field().offset(leaves.begin), fit.field().offset(leaves.end)};
}

// Writes a checkpoint if there are moments, else a model.
void save(const std::filesystem::path& path, const fit::Fit& fit, const output::ModelInfo& info,
          const output::TrainingState& state,
          const std::map<std::string, std::span<const float>>& moments) {
  fit.processes().run_collectively([&] { output::require_finite(fit.field(), path); });
  distributed::GatheredArrays arrays = own_parts(fit);
  const auto source = [&](std::span<const float> values) {
    const std::size_t array = arrays.add(values);
    return output::FloatSource(
        values.size(),
        [&arrays, array](const output::FloatSource::Sink& sink) { arrays.hand_out(array, sink); });
  };
  const output::FloatSource parameters = source(fit.field().parameters());
  output::FloatArrays more;
  for (const auto& [name, values] : moments) more.emplace(name, source(values));
  arrays.read_on_root(
      [&] { output::save_model(path, fit.field(), parameters, info, &state, more); });
}

}  // namespace

std::string fingerprint_of(const ReconstructOptions& options,
                           const measurement::Measurement& series,
                           const distributed::Communicator& processes) {
  nlohmann::json json = options_json(options);
  json.erase("input");
  json.erase("volume");
  json["tilt_deg"] = series.geometry.tilt_deg;
  if (series.ray_geometry) json["alignment"] = alignment_json(*series.ray_geometry);
  json["bin_factor"] = series.bin_factor;
  json["unit"] = series.unit;
  json["noise_sigma"] = series.noise_sigma;
  json["rays"] = fmt::format("{:016x}", series.rays->checksum(processes));
  return json.dump();
}

output::TrainingState progress_state(const fit::Fit& fit, const FitOrigin& origin) {
  output::TrainingState state;
  const fit::Progress& progress = fit.progress();
  state.integers["fingerprint"] = as_numbers(origin.fingerprint);
  if (origin.tuned) state.integers["tuning"] = as_numbers(without_times(*origin.tuned).dump());
  state.integers["step"] = {progress.step};
  state.doubles["views"] = flatten(progress.views);
  state.doubles["epoch_sums"] = flatten(progress.epoch_sums);
  state.doubles["data_loss"] = progress.data_loss;
  store(progress.tree, state);
  state.doubles["held_out_error"] = progress.held_out_error;
  return state;
}

void save_fit(const std::filesystem::path& path, const fit::Fit& fit, const output::ModelInfo& info,
              const output::TrainingState& state) {
  save(path, fit, info, state, {});
}

void save_checkpoint(const std::filesystem::path& path, const fit::Fit& fit,
                     const output::ModelInfo& info, const FitOrigin& origin) {
  const base::TraceSpan span("write checkpoint");
  output::TrainingState state = progress_state(fit, origin);
  const fit::Adam::State& adam = fit.optimizer().state();
  std::vector<std::int64_t> leaf_steps(adam.leaf_steps.size());
  for (int leaf = fit.own_leaves().begin; leaf < fit.own_leaves().end; ++leaf)
    leaf_steps[static_cast<std::size_t>(leaf)] = adam.leaf_steps[static_cast<std::size_t>(leaf)];
  fit.processes().allreduce_sum(std::span(leaf_steps));
  state.integers["leaf_steps"] = std::move(leaf_steps);
  state.doubles["bias_moments"] = {adam.bias_m, adam.bias_v};
  state.integers["bias_steps"] = {adam.bias_steps};
  save(path, fit, info, state, {{"adam_m", adam.m}, {"adam_v", adam.v}});
}

std::optional<TunedFit> stored_choice(const std::filesystem::path& path) {
  output::TrainingState state;
  output::load_part(
      path, [](const field::Quadtree&) { return std::vector<int>(); }, state);
  const auto tuning = state.integers.find("tuning");
  if (tuning == state.integers.end()) return std::nullopt;
  try {
    return tuned_from(nlohmann::json::parse(as_text(tuning->second)));
  } catch (const nlohmann::json::exception& error) {
    throw Error(fmt::format("'{}' is damaged: its tuning ({})", path.string(), error.what()));
  }
}

void restore_fit(const std::filesystem::path& file, const std::string& fingerprint, fit::Fit& fit) {
  const std::string path = file.string();
  output::TrainingState state;
  output::Model model = output::load_part(
      file, [&](const field::Quadtree& tree) { return fit.kept_leaves(tree); }, state);
  const std::string found = as_text(entry(state.integers, "fingerprint", path));
  if (found != fingerprint) {
    throw Error(
        fmt::format("'{}' was made from another series or with other options (these differ: {})",
                    path, differences(found, fingerprint)));
  }
  fit::Progress progress;
  progress.step = entry(state.integers, "step", path).at(0);
  progress.views = unflatten_views(entry(state.doubles, "views", path));
  progress.epoch_sums = unflatten_sums(entry(state.doubles, "epoch_sums", path));
  progress.data_loss = entry(state.doubles, "data_loss", path);
  progress.tree = unflatten_tree(entry(state.integers, "tree_updates", path),
                                 entry(state.doubles, "tree_errors", path));
  progress.held_out_error = entry(state.doubles, "held_out_error", path);
  fit.go_on_from(std::move(progress), std::move(model.field));
  if (fit.is_done()) return;
  fit::Adam::State& adam = fit.optimizer().state();
  output::load_floats(file, "adam_m", fit.field(), adam.m);
  output::load_floats(file, "adam_v", fit.field(), adam.v);
  adam.leaf_steps = entry(state.integers, "leaf_steps", path);
  adam.bias_m = entry(state.doubles, "bias_moments", path).at(0);
  adam.bias_v = entry(state.doubles, "bias_moments", path).at(1);
  adam.bias_steps = entry(state.integers, "bias_steps", path).at(0);
}

}  // namespace tomofield::reconstruction
