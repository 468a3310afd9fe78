#include "options/run_options.h"

#include <fmt/format.h>

#include <algorithm>
#include <bit>

#include "compact/budget.h"
#include "fit/integer_program.h"
#include "fit/stages.h"
#include "measurement/view_transfers.h"
#include "option_table/values.h"
#include "options/denoise_factor.h"
#include "output/shared_options.h"
#include "tune/automatic_choice.h"
#include "tune/tuning.h"

namespace tomofield::options {
namespace {

fit::FieldOptions field_options(const Options& options) {
  fit::FieldOptions field;
  field.kind = options.field.value_or(field.kind);
  field.tree = options.tree;
  field.leaf_size = options.leaf_size.value_or(fit::usual_leaf_size(field));
  field.depth = fit::usual_depth(field);
  field.leaf_budget = options.leaf_budget;
  field.vertex_spacing = options.vertex_spacing;
  field.rank = options.rank;
  field.with_margin = options.with_margin;
  field.margin_spacing = options.margin_spacing;
  field.activation = options.activation.value_or(field.activation);
  return field;
}

fit::FitOptions fit_options(const Options& options) {
  fit::FitOptions fit;
  fit.epochs = options.epochs.value_or(fit.epochs);
  fit.vertex_epochs = options.vertex_epochs.value_or(fit.vertex_epochs);
  fit.coarse_epochs = options.coarse_epochs.value_or(fit.coarse_epochs);
  fit.coarse_bin = options.coarse_bin;
  fit.subsets = options.subsets;
  fit.engine = options.engine;
  fit.ray_samples = options.ray_samples;
  fit.rays_per_step = options.rays_per_step;
  fit.learning_rate = options.learning_rate.value_or(fit.learning_rate);
  fit.density_variation = options.density_variation.value_or(fit.density_variation);
  fit.factor_variation = options.factor_variation;
  fit.boundary = options.boundary;
  fit.fourier = options.fourier;
  fit.fourier_ring = options.fourier_ring;
  fit.penalty = options.penalty.value_or(fit.penalty);
  fit.spike_rank = options.spike_rank.value_or(fit.spike_rank);
  fit.fit_noise = options.fit_noise;
  fit.noise_model = options.noise_model;
  fit.fit_view_scale = options.fit_view_scale.value_or(fit.fit_view_scale);
  fit.seed = options.seed;
  fit.prior = options.prior.value_or(fit.prior);
  fit.hold_out = options.hold_out;
  fit.patience = options.patience;
  return fit;
}

void choose_schedule(const SeriesFiles& files, Options& options) {
  const fit::FieldOptions field = field_options(options);
  fit::FitOptions fit = fit_options(options);
  // One epoch stands for any number: the usual schedule depends on which stages there are.
  fit.coarse_epochs = options.coarse_epochs.value_or(1);
  const bool has_vertices = fit::begins_with_vertices(field, fit);
  fit.vertex_epochs = options.vertex_epochs.value_or(has_vertices ? 1 : 0);
  const fit::Schedule usual =
      fit::usual_schedule(field, fit, measurement::wants_transfers(files, options));
  const int epochs = options.epochs.value_or(usual.epochs);
  const int vertex_epochs =
      options.vertex_epochs.value_or(has_vertices ? usual.vertex_epochs_of(epochs) : 0);
  options.epochs = epochs;
  options.vertex_epochs = vertex_epochs;
  if (!options.coarse_epochs)
    options.coarse_epochs = usual.coarse_epochs_of(std::max(epochs, vertex_epochs));
  if (!options.learning_rate) options.learning_rate = usual.learning_rate;
}

// Chooses plain vertices, unless other options are for factors.
void choose_field(Options& options) {
  const bool is_for_factors = options.tree == TreeKind::kAdaptive || options.vertex_epochs > 0;
  if (!options.field) options.field = is_for_factors ? FieldKind::kVm : FieldKind::kGrid;
}

void choose_variation(Options& options) {
  if (!options.penalty && options.density_variation) options.penalty = fit::FitOptions{}.penalty;
  if (options.penalty && !options.density_variation)
    options.density_variation = objective::usual_variation(*options.penalty);
}

// Says whether the fit can end with the learned prior.
bool may_learn(const Options& options) {
  return options.budget.empty() &&
         fit::can_have_learned_prior(field_options(options), fit_options(options));
}

}  // namespace

Options resolve(const SeriesFiles& files, const Options& requested) {
  Options options = requested;
  option_table::choose_by_contrast(options);
  options.fit_view_scale = requested.fit_view_scale;  // trials choose it
  choose_field(options);
  options.leaf_size = field_options(options).leaf_size;
  choose_schedule(files, options);
  choose_variation(options);
  return options;
}

ReconstructOptions run_options(const SeriesFiles& files, const Options& requested) {
  ReconstructOptions run;
  run.files = files;
  run.requested = requested;
  run.resolved = resolve(files, requested);
  const bool is_bright = run.resolved.contrast == Contrast::kBright;
  run.open = {.variation = !run.resolved.penalty,
              .spikes = !run.resolved.penalty && !requested.spike_rank,
              .view_scale = !requested.fit_view_scale,
              .background = is_bright && !requested.black_level,
              .beads = is_bright && !requested.bead_diameter_nm};
  option_table::choose_by_contrast(run.resolved);
  run.open.prior = !requested.prior && run.chooses_weight() && may_learn(run.resolved);
  if (!run.resolved.prior) run.resolved.prior = fit::FitOptions{}.prior;
  if (run.open.variation) {
    run.resolved.penalty = fit::FitOptions{}.penalty;
    choose_variation(run.resolved);
  }
  run.input = output::series_options(files, run.resolved);
  run.specimen = output::specimen_options(run.resolved);
  run.field = field_options(run.resolved);
  run.fit = fit_options(run.resolved);
  run.volume = output::volume_options(run.resolved);
  return run;
}

ReconstructOptions ReconstructOptions::with_open_prior() const {
  ReconstructOptions longest = *this;
  if (open.prior) longest.fit.prior = Prior::kLearned;
  return longest;
}

int ReconstructOptions::num_trials(int num_fitted_views,
                                   const tune::OpenSettings& to_choose) const {
  constexpr int kMinViews = 12;
  if (resolved.tune)
    return tune::expected_trials(
        {.penalty = to_choose.variation, .rank = field.kind == FieldKind::kVm});
  if (fit.engine != Engine::kSlab || num_fitted_views < kMinViews) return 0;
  return tune::usual_trials(to_choose);
}

std::vector<std::string> ReconstructOptions::faults() const {
  std::vector<std::string> all = option_table::range_faults(resolved);
  const auto refuse_if = [&](bool is_fault, const char* sentence) {
    if (is_fault) all.emplace_back(sentence);
  };
  const bool is_ray = fit.engine == Engine::kRay;
  refuse_if(fit.coarse_bin > 0 && !std::has_single_bit(static_cast<unsigned>(fit.coarse_bin)),
            "--coarse-bin is the largest of binnings that are halved from stage to stage: give a "
            "power of two, such as 2, 4 or 8");
  refuse_if(field.tree == TreeKind::kAdaptive && !fit::can_solve_integer_programs(),
            "--tree adaptive needs COIN-OR CBC, and this tomofield was built without it: take "
            "--tree uniform, or build tomofield with -DTOMOFIELD_WITH_CBC=ON");
  refuse_if(field.leaf_budget > 0 && field.tree == TreeKind::kUniform,
            "--leaf-budget is for --tree adaptive alone");
  refuse_if(fit.vertex_epochs > 0 && is_ray,
            "--vertex-epochs needs --engine slab: with rays factors are fitted from the start");
  refuse_if(
      fit.vertex_epochs > 0 && (field.kind != FieldKind::kVm || field.tree != TreeKind::kUniform),
      "--vertex-epochs is for the factors of a uniform tree: leave it out, or give --field "
      "vm and --tree uniform");
  try {
    denoise_factor(resolved.denoise);
  } catch (const Error& error) {
    all.emplace_back(error.what());
  }
  refuse_if(fit.prior != Prior::kTv && !may_learn(resolved),
            "--prior learned works on plain vertices a pixel apart: it needs --field grid, --tree "
            "uniform, --vertex-spacing 1 and --engine slab, and no --budget");
  refuse_if(resolved.density_variation == 0.0 && !chooses_weight() &&
                resolved.denoise != Options().denoise,
            "--denoise multiplies the weight of total variation, and --tv 0 turns that off: leave "
            "one of them out");
  refuse_if(fit.patience > 0 && fit.hold_out == 0,
            "--early-stop watches views that --hold-out keeps from the fit: give that as well");
  refuse_if(fit.hold_out > 0 && is_ray,
            "--hold-out predicts aligned views: it needs --engine slab");
  refuse_if(resolved.tune && is_ray, "--tune predicts aligned views: it needs --engine slab");
  refuse_if(resolved.tune && fit.patience > 0,
            "--tune chooses the number of epochs: leave --early-stop out");
  refuse_if(resolved.resume && resolved.output.empty(),
            "--resume continues from the files of an interrupted run: give their output");
  refuse_if(resolved.align != Alignment::kOff && is_ray,
            "--align refine aligns views in their plane: it needs --engine slab");
  if (!resolved.budget.empty()) {
    try {
      compact::parse_budget(resolved.budget);
    } catch (const Error& error) {
      all.push_back(fmt::format("--budget {}", error.what()));
    }
    refuse_if(field.kind != FieldKind::kGrid,
              "--budget makes plain vertices compact: give --field grid");
    refuse_if(makes_halves(), "--budget is for one fit, and halves need three: leave it out");
  }
  refuse_if(resolved.tile_rows.value_or(0) > 0 && resolved.budget.empty(),
            "--tile-rows fits tiles that are made compact: give --budget as well");
  for (const char* sentence : faults_of_halves()) all.emplace_back(sentence);
  for (const char* sentence : faults_of_transfer()) all.emplace_back(sentence);
  return all;
}

// Returns a sentence for each option that does not go with halves, or needs them.
std::vector<const char*> ReconstructOptions::faults_of_halves() const {
  std::vector<const char*> all;
  const auto refuse_if = [&](bool is_fault, const char* sentence) {
    if (is_fault) all.push_back(sentence);
  };
  refuse_if(files.even.has_value() != files.odd.has_value(),
            "--even and --odd are the two halves of the frames: give both");
  refuse_if(files.even && files.odd && resolved.split_tilts,
            "--even and --odd divide the frames, --split-tilts the tilts: choose one of them");
  refuse_if(resolved.denoising_halves && !makes_halves(),
            "--denoising-halves needs halves: give --even and --odd, or --split-tilts");
  if (!makes_halves()) return all;
  refuse_if(fit.engine == Engine::kRay, "halves need --engine slab");
  refuse_if(field.tree == TreeKind::kAdaptive,
            "halves need --tree uniform, because adaptive trees of two fits would differ");
  refuse_if(fit.patience > 0,
            "halves need fits of the same length: leave --early-stop out, or choose --epochs");
  refuse_if(resolved.output.empty(), "halves are written as files: name the tomogram");
  return all;
}

// Returns a sentence for each option of contrast transfer, dose and noise that does not go with
// others.
std::vector<const char*> ReconstructOptions::faults_of_transfer() const {
  std::vector<const char*> all = measurement::faults_of_transfer(files, resolved);
  if (fit.engine != Engine::kRay) return all;
  if (measurement::wants_transfers(files, resolved))
    all.push_back(
        "--ctf, --defocus, --dose-per-tilt and --mtf filter aligned views: they need --engine "
        "slab");
  if (fit.noise_model == NoiseModel::kColoured)
    all.push_back(
        "--noise-model coloured weights the frequencies of aligned views: it needs --engine slab");
  return all;
}

std::vector<std::string> ReconstructOptions::faults_of_job() const {
  std::vector<std::string> all;
  const auto refuse = [&](const char* option) {
    all.push_back(fmt::format(
        "several processes cannot share {} yet: start one, with more --threads", option));
  };
  if (field.tree == TreeKind::kAdaptive) refuse("--tree adaptive");
  if (fit.engine == Engine::kRay) refuse("--engine ray");
  if (resolved.denoising_halves) refuse("--denoising-halves");
  if (!resolved.budget.empty()) refuse("--budget");
  return all;
}

nlohmann::json options_json(const ReconstructOptions& options) {
  nlohmann::json all = option_table::to_json(options.files, options.resolved);
  all.erase("running");  // says where the results are, not what they are made from
  const fit::FieldOptions& field = options.field;
  all["field"].update({{"depth", field.depth},
                       {"margin_rank", field.margin_rank},
                       {"sharpness", field.sharpness},
                       {"initial_scale", field.initial_scale}});
  const fit::FitOptions& fit = options.fit;
  all["fit"].update({{"final_rate", fit.final_rate},
                     {"coarse_final_rate", fit.coarse_final_rate},
                     {"refined_rate", fit.refined_rate},
                     {"vertex_rate", fit.vertex_rate},
                     {"factorised_rate", fit.factorised_rate},
                     {"concavity", fit.concavity},
                     {"gradient_floor", fit.gradient_floor}});
  return all;
}

}  // namespace tomofield::options
