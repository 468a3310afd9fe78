#include "checkpoint/checkpoint.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <span>
#include <utility>

#include "base/range.h"
#include "base/trace.h"
#include "distributed/gathered_arrays.h"
#include "options/options_record.h"
#include "output/model_file.h"
#include "tomofield/error.h"

namespace tomofield::checkpoint {
namespace {

// Writes seven numbers for each view, in the order of the members.
std::vector<double> flatten(const std::vector<measurement::ViewSums>& sums) {
  std::vector<double> flat;
  for (const measurement::ViewSums& s : sums)
    flat.insert(flat.end(), {s.n, s.p, s.b, s.pp, s.pb, s.bb, s.limited_squares});
  return flat;
}

std::vector<measurement::ViewSums> unflatten_sums(const std::vector<double>& flat) {
  std::vector<measurement::ViewSums> sums;
  if (flat.size() % 7 != 0) return {};
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
  if (flat.size() % 4 != 0) return {};
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

// Returns nothing if the numbers are not what store() writes.
std::optional<fit::TreeProgress> unflatten_tree(std::span<const std::int64_t> numbers,
                                                std::span<const double> errors) {
  constexpr std::size_t kNumbers = 4, kErrors = 2, kMostLevels = 64;
  if (numbers.empty()) return std::nullopt;
  fit::TreeProgress tree;
  tree.is_frozen = numbers[0] != 0;
  numbers = numbers.subspan(1);
  while (!numbers.empty()) {
    if (numbers.size() < kNumbers || errors.size() < kErrors) return std::nullopt;
    const auto num_levels = static_cast<std::size_t>(numbers[3]);
    if (num_levels > std::min(kMostLevels, numbers.size() - kNumbers)) return std::nullopt;
    const auto levels = numbers.subspan(kNumbers, num_levels);
    tree.updates.push_back({.epoch = numbers[0],
                            .splits = numbers[1],
                            .merges = numbers[2],
                            .error = errors[0],
                            .predicted_error = errors[1],
                            .leaves_by_level = {levels.begin(), levels.end()}});
    numbers = numbers.subspan(kNumbers + num_levels);
    errors = errors.subspan(kErrors);
  }
  return errors.empty() ? std::optional(std::move(tree)) : std::nullopt;
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

// Returns the single number of an entry.
std::int64_t single(const output::TrainingState& state, const char* name, const std::string& path) {
  const auto& numbers = entry(state.integers, name, path);
  if (numbers.size() != 1)
    throw Error(fmt::format("'{}' is damaged: '{}' has {} numbers", path, name, numbers.size()));
  return numbers.front();
}

fit::Progress progress_from(const output::TrainingState& state, const std::string& path) {
  fit::Progress progress;
  progress.step = single(state, "step", path);
  progress.views = unflatten_views(entry(state.doubles, "views", path));
  progress.epoch_sums = unflatten_sums(entry(state.doubles, "epoch_sums", path));
  progress.data_loss = entry(state.doubles, "data_loss", path);
  progress.view_residual = entry(state.doubles, "view_residual", path);
  progress.held_out_error = entry(state.doubles, "held_out_error", path);
  auto tree = unflatten_tree(entry(state.integers, "tree_updates", path),
                             entry(state.doubles, "tree_errors", path));
  if (!tree)
    throw Error(fmt::format("'{}' is damaged: its updates of the tree are incomplete", path));
  progress.tree = std::move(*tree);
  return progress;
}

// Refuses an optimiser whose numbers no fit could have. Adam divides by the roots of the second
// moments.
void require_sound(const fit::Adam::State& adam, const fit::Fit& fit, const std::string& path) {
  const auto is_count = [&](std::int64_t steps) {
    return steps >= 0 && steps <= fit.progress().step;
  };
  const auto is_moment = [](auto value) { return std::isfinite(value); };
  const auto is_square = [](auto value) { return std::isfinite(value) && value >= 0; };
  if (std::ssize(adam.leaf_steps) == fit.field().tree().num_leaves() &&
      std::ranges::all_of(adam.leaf_steps, is_count) && is_count(adam.bias_steps) &&
      is_moment(adam.bias_m) && is_square(adam.bias_v) && std::ranges::all_of(adam.m, is_moment) &&
      std::ranges::all_of(adam.v, is_square))
    return;
  throw Error(fmt::format("'{}' is damaged: the state of its optimiser is none of this fit", path));
}

void restore_optimizer(const std::filesystem::path& file, const output::TrainingState& state,
                       fit::Fit& fit) {
  const std::string path = file.string();
  fit::Adam::State& adam = fit.optimizer().state();
  const auto& bias_moments = entry(state.doubles, "bias_moments", path);
  if (bias_moments.size() != 2)
    throw Error(
        fmt::format("'{}' is damaged: it has {} moments of the bias", path, bias_moments.size()));
  adam.leaf_steps = entry(state.integers, "leaf_steps", path);
  adam.bias_m = bias_moments[0];
  adam.bias_v = bias_moments[1];
  adam.bias_steps = single(state, "bias_steps", path);
  output::load_floats(file, "adam_m", fit.field(), adam.m);
  output::load_floats(file, "adam_v", fit.field(), adam.v);
  require_sound(adam, fit, path);
}

// Restores what the stages of the learned prior keep beside the field.
void restore_prior_state(const std::filesystem::path& file, const output::TrainingState& state,
                         fit::Fit& fit) {
  const std::string path = file.string();
  if (single(state, "has_prior_state", path) != 1)
    throw Error(fmt::format("'{}' is damaged: it lacks the state of the learned prior", path));
  base::AlignedBuffer<float> values(fit.field().num_parameters());
  output::load_floats(file, "prior_state", fit.field(), values);
  if (!std::ranges::all_of(values, [](float value) { return std::isfinite(value); }))
    throw Error(fmt::format("'{}' is damaged: the state of its learned prior is not finite", path));
  fit.restore_prior_state(std::move(values));
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
  fit.processes().run_collectively([&] { output::require_converged(fit.field()); });
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

std::vector<std::int64_t> as_numbers(const std::string& text) { return {text.begin(), text.end()}; }
std::string as_text(const std::vector<std::int64_t>& numbers) {
  std::string text;
  for (const std::int64_t number : numbers) text.push_back(static_cast<char>(number));
  return text;
}

output::ModelInfo model_info(const measurement::Measurement& series,
                             const options::ReconstructOptions& options) {
  output::ModelInfo info = output::model_info(series, options.views.contrast);
  options::ReconstructOptions resolved = options;
  resolved.views.bin = series.bin_factor;  // --angpix may have set it
  info.options_json = options::options_text(resolved);
  if (options.alignment) info.alignment_json = alignment::text_of(options.alignment->origin);
  return info;
}

output::TrainingState progress_state(const fit::Fit& fit, const FitOrigin& origin) {
  output::TrainingState state;
  const fit::Progress& progress = fit.progress();
  state.integers["fingerprint"] = as_numbers(origin.fingerprint);
  if (origin.tuned) state.integers["tuning"] = as_numbers(trials_text(*origin.tuned));
  if (origin.tile_rows && !origin.are_tile_rows_given)
    state.integers["tile_rows"] = {*origin.tile_rows};
  state.integers["step"] = {progress.step};
  state.doubles["views"] = flatten(progress.views);
  state.doubles["epoch_sums"] = flatten(progress.epoch_sums);
  state.doubles["data_loss"] = progress.data_loss;
  state.doubles["view_residual"] = progress.view_residual;
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
  std::map<std::string, std::span<const float>> moments{{"adam_m", adam.m}, {"adam_v", adam.v}};
  if (!fit.prior_state().empty()) moments.emplace("prior_state", fit.prior_state());
  state.integers["has_prior_state"] = {fit.prior_state().empty() ? 0 : 1};
  save(path, fit, info, state, moments);
}

std::optional<tune::TunedFit> stored_choice(const std::filesystem::path& path) {
  const output::TrainingState state = output::load_training(path);
  const auto tuning = state.integers.find("tuning");
  if (tuning == state.integers.end()) return std::nullopt;
  try {
    return trials_from(as_text(tuning->second));
  } catch (const Error& error) {
    throw Error(fmt::format("'{}' is damaged: its tuning ({})", path.string(), error.what()));
  }
}

std::optional<int> stored_tile_rows(const std::filesystem::path& path) {
  constexpr std::int64_t kMost = 1 << 30;
  const output::TrainingState state = output::load_training(path);
  if (!state.integers.contains("tile_rows")) return std::nullopt;
  const std::int64_t rows = single(state, "tile_rows", path.string());
  if (rows >= 0 && rows <= kMost) return static_cast<int>(rows);
  throw Error(fmt::format("'{}' is damaged: its tiles have {} rows", path.string(), rows));
}

void require_state_of_fit(const std::filesystem::path& path) {
  if (output::load_training(path).integers.contains("fingerprint")) return;
  throw Error(
      fmt::format("'{}' is no checkpoint: it has no state of a fit, as no compact model has one, "
                  "of which `tomofield export` makes the tomogram",
                  path.string()));
}

void restore_fit(const std::filesystem::path& file, const std::string& fingerprint, fit::Fit& fit) {
  const std::string path = file.string();
  const output::TrainingState state = output::load_training(file);
  const std::string found = as_text(entry(state.integers, "fingerprint", path));
  if (found != fingerprint) {
    throw Error(
        fmt::format("'{}' was made from another series or with other options (these differ: {})",
                    path, different_options(found, fingerprint)));
  }
  const auto require_no_fault = [&](const std::string& fault) {
    if (!fault.empty()) throw Error(fmt::format("'{}' is no state of this fit: {}", path, fault));
  };
  output::Model model = output::load_part(file, [&](const field::Quadtree& tree) {
    require_no_fault(fit.fault_of(tree));
    return fit.kept_leaves(tree);
  });
  fit::Progress progress = progress_from(state, path);
  require_no_fault(fit.fault_of(progress, *model.field));
  fit.go_on_from(std::move(progress), std::move(model.field));
  if (fit.is_done()) return;
  restore_optimizer(file, state, fit);
  if (fit.stage().is_light) restore_prior_state(file, state, fit);
}

void read_checkpoint(const std::function<void()>& read) {
  try {
    read();
  } catch (const Error& error) {
    throw Error(fmt::format(
        "cannot resume: {}; to start over, give --overwrite instead of --resume", error.what()));
  }
}

}  // namespace tomofield::checkpoint
