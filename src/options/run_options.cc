#include "options/run_options.h"

#include <fmt/format.h>

#include <algorithm>
#include <bit>
#include <cstdlib>
#include <string>
#include <utility>
#include <vector>

#include "base/check.h"
#include "compact/budget.h"
#include "fit/constants.h"
#include "fit/integer_program.h"
#include "fit/stages.h"
#include "measurement/view_transfers.h"
#include "objective/constants.h"
#include "option_table/setting.h"
#include "option_table/values.h"
#include "tilt_series/series_plan.h"
#include "tomofield/error.h"
#include "tune/automatic_choice.h"
#include "tune/tuning.h"

namespace tomofield::options {
namespace {

void choose_schedule(const SeriesFiles& files, Options& options) {
  FitOptions fit = options.fit;
  // usual_schedule() only asks whether there are coarse and vertex stages. Where their length is
  // still open, 1 says that there are.
  if (fit.coarse_epochs.is_open()) fit.coarse_epochs = 1;
  const bool has_vertices = fit::begins_with_vertices(options.field, fit);
  if (fit.vertex_epochs.is_open()) fit.vertex_epochs = has_vertices ? 1 : 0;
  const fit::Schedule usual =
      fit::usual_schedule(options.field, fit, measurement::wants_transfers(files, options.views));
  FitOptions& chosen = options.fit;
  chosen.epochs.derive(usual.epochs);
  chosen.vertex_epochs.derive(has_vertices ? usual.vertex_epochs_of(chosen.epochs) : 0);
  chosen.coarse_epochs.derive(
      usual.coarse_epochs_of(std::max(*chosen.epochs, *chosen.vertex_epochs)));
  chosen.learning_rate.derive(usual.learning_rate);
}

// Chooses plain vertices, unless other options are for factors.
void choose_field(Options& options) {
  const bool is_for_factors =
      options.field.tree == TreeKind::kAdaptive || options.fit.vertex_epochs.chosen_or(0) > 0;
  options.field.kind.derive(is_for_factors ? FieldKind::kVm : FieldKind::kGrid);
  options.field.leaf_size.derive(fit::usual_leaf_size(options.field));
}

// Chooses the penalty by its weight or the weight by its penalty; if neither is given, trials do.
void choose_variation(FitOptions& fit) {
  if (!fit.density_variation.is_open()) fit.penalty.derive(*fit.penalty);
  if (!fit.penalty.is_open()) fit.density_variation.derive(objective::usual_variation(fit.penalty));
}

// Says whether the fit can end with the learned prior.
bool may_learn(const Options& options) {
  return options.field.budget.empty() && fit::can_have_learned_prior(options.field, options.fit);
}

constexpr double kLeastFactor = 0.05, kMostFactor = 20;

std::vector<std::string> faults_of_field(const ReconstructOptions& options) {
  const FieldOptions& field = options.field;
  const FitOptions& fit = options.fit;
  base::Faults faults;
  faults.add_if(field.tree == TreeKind::kAdaptive && !fit::can_solve_integer_programs(),
                "--tree adaptive needs COIN-OR CBC, and this tomofield was built without it: take "
                "--tree uniform, or build tomofield with -DTOMOFIELD_WITH_CBC=ON");
  faults.add_if(field.leaf_budget > 0 && field.tree == TreeKind::kUniform,
                "--leaf-budget is for --tree adaptive alone");
  faults.add_if(fit.vertex_epochs > 0 && fit.engine == Engine::kRay,
                "--vertex-epochs needs --engine slab: with rays factors are fitted from the start");
  faults.add_if(
      fit.vertex_epochs > 0 && (field.kind != FieldKind::kVm || field.tree != TreeKind::kUniform),
      "--vertex-epochs is for the factors of a uniform tree: leave it out, or give --field "
      "vm and --tree uniform");
  return faults.sentences();
}

std::vector<std::string> faults_of_fit(const ReconstructOptions& options) {
  const FitOptions& fit = options.fit;
  const bool is_ray = fit.engine == Engine::kRay;
  base::Faults faults;
  faults.add_if(
      fit.coarse_bin > 0 && !std::has_single_bit(static_cast<unsigned>(fit.coarse_bin)),
      "--coarse-bin is the largest of binnings that are halved from stage to stage: give a "
      "power of two, such as 2, 4 or 8");
  faults.add_if(
      fit.prior != Prior::kTv && !may_learn(options),
      "--prior learned works on plain vertices a pixel apart: it needs --field grid, --tree "
      "uniform, --vertex-spacing 1 and --engine slab, and no --budget");
  faults.collect([&] {
    const double factor = denoise_factor(fit.denoise);
    faults.add_if(fit.density_variation == 0.0 && !options.chooses_weight() && factor != 1.0,
                  "--denoise multiplies the weight of total variation, and --tv 0 turns that "
                  "off: leave one of them out");
  });
  faults.add_if(fit.patience > 0 && fit.hold_out == 0,
                "--early-stop watches views that --hold-out keeps from the fit: give that as well");
  faults.add_if(fit.hold_out > 0 && is_ray,
                "--hold-out predicts aligned views: it needs --engine slab");
  faults.add_if(fit.tune && is_ray, "--tune predicts aligned views: it needs --engine slab");
  faults.add_if(fit.tune && fit.patience > 0,
                "--tune chooses the number of epochs: leave --early-stop out");
  return faults.sentences();
}

std::vector<std::string> faults_of_run(const ReconstructOptions& options) {
  const RunOptions& run = options.run;
  base::Faults faults;
  faults.add_if(run.resume && run.overwrite,
                "--resume continues a run and --overwrite starts it over: give one of them");
  faults.add_if(run.resume && run.output.empty(),
                "--resume continues from the files of an interrupted run: give their output");
  faults.add_if(run.align != Alignment::kOff && options.fit.engine == Engine::kRay,
                "--align aligns views in their plane: it needs --engine slab");
  return faults.sentences();
}

std::vector<std::string> faults_of_budget(const ReconstructOptions& options) {
  const FieldOptions& field = options.field;
  base::Faults faults;
  if (!field.budget.empty()) {
    faults.collect([&] { compact::parse_budget(field.budget); }, "--budget ");
    faults.add_if(field.kind != FieldKind::kGrid,
                  "--budget makes plain vertices compact: give --field grid");
    faults.add_if(options.makes_halves(),
                  "--budget is for one fit, and halves need three: leave it out");
  }
  faults.add_if(field.tile_rows.value_or(0) > 0 && field.budget.empty(),
                "--tile-rows fits tiles that are made compact: give --budget as well");
  return faults.sentences();
}

std::vector<std::string> faults_of_halves(const ReconstructOptions& options) {
  const SeriesFiles& files = options.files;
  const FitOptions& fit = options.fit;
  base::Faults faults;
  faults.add_if(files.even.has_value() != files.odd.has_value(),
                "--even and --odd are the two halves of the frames: give both");
  faults.add_if(files.even && files.odd && fit.split_tilts,
                "--even and --odd divide the frames, --split-tilts the tilts: choose one of them");
  faults.add_if(fit.denoising_halves && !options.makes_halves(),
                "--denoising-halves needs halves: give --even and --odd, or --split-tilts");
  if (!options.makes_halves()) return faults.sentences();
  faults.add_if(fit.engine == Engine::kRay, "halves need --engine slab");
  faults.add_if(options.field.tree == TreeKind::kAdaptive,
                "halves need --tree uniform, because adaptive trees of two fits would differ");
  faults.add_if(fit.patience > 0,
                "halves need fits of the same length: leave --early-stop out, or choose --epochs");
  faults.add_if(options.run.output.empty(), "halves are written as files: name the tomogram");
  return faults.sentences();
}

// Returns a sentence for each option that filters aligned views where the views are as recorded.
std::vector<std::string> faults_of_filters(const ReconstructOptions& options) {
  const bool is_ray = options.fit.engine == Engine::kRay;
  base::Faults faults;
  faults.add_if(
      is_ray && measurement::wants_transfers(options.files, options.views),
      "--ctf, --defocus, --dose-per-tilt and --mtf filter aligned views: they need --engine "
      "slab");
  faults.add_if(
      is_ray && options.fit.noise_model == NoiseModel::kColoured,
      "--noise-model coloured weights the frequencies of aligned views: it needs --engine slab");
  return faults.sentences();
}

}  // namespace

Options resolve(const SeriesFiles& files, const Options& requested) {
  option_table::Choices choices{files, requested};
  option_table::settle_settings(choices);
  Options options = std::move(choices.options);
  option_table::choose_by_contrast(options);
  choose_field(options);
  choose_schedule(files, options);
  choose_variation(options.fit);
  return options;
}

ReconstructOptions run_options(const SeriesFiles& files, const Options& requested) {
  return {resolve(files, requested), files};
}

tilt_series::TiltSeriesOptions ReconstructOptions::input() const {
  tilt_series::TiltSeriesOptions input = tilt_series::series_options(files, *this);
  input.images = images;
  input.corrections = corrections;
  input.left_out = left_out;
  return input;
}

tune::OpenSettings ReconstructOptions::open_settings() const {
  const bool is_bright = views.contrast == Contrast::kBright;
  const bool is_open = fit.penalty.is_left_to_trials();
  return {.variation = is_open,
          .spikes = is_open && fit.spike_rank.is_left_to_trials(),
          .view_scale = fit.fit_view_scale.is_left_to_trials(),
          .background = is_bright && views.black_level.is_left_to_trials(),
          .beads = is_bright && views.bead_diameter_nm.is_left_to_trials(),
          .prior = fit.prior.is_left_to_trials() && chooses_weight() && may_learn(*this)};
}

ReconstructOptions ReconstructOptions::with_open_prior() const {
  ReconstructOptions longest = *this;
  if (open_settings().prior) longest.fit.prior = Prior::kLearned;
  return longest;
}

int ReconstructOptions::num_trials(int num_fitted_views,
                                   const tune::OpenSettings& to_choose) const {
  if (fit.tune)
    return tune::expected_trials(
        {.penalty = to_choose.variation, .rank = *field.kind == FieldKind::kVm});
  if (fit.engine != Engine::kSlab || num_fitted_views < kFewestViewsOfTrials) return 0;
  return tune::usual_trials(to_choose);
}

std::vector<std::string> ReconstructOptions::faults() const {
  std::vector<std::string> all = option_table::range_faults(*this);
  const auto add = [&](const auto& faults) { all.insert(all.end(), faults.begin(), faults.end()); };
  add(output::faults_of(volume));
  add(faults_of_field(*this));
  add(faults_of_fit(*this));
  add(faults_of_run(*this));
  add(faults_of_budget(*this));
  add(faults_of_halves(*this));
  add(measurement::faults_of_transfer(files, views));
  add(faults_of_filters(*this));
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
  if (fit.denoising_halves) refuse("--denoising-halves");
  if (!field.budget.empty()) refuse("--budget");
  return all;
}

double denoise_factor(const std::string& text) {
  for (const DenoisePlace& place : kDenoisePlaces)
    if (text == place.name) return place.factor;
  char* end = nullptr;
  const double factor = std::strtod(text.c_str(), &end);
  if (end == text.c_str() || *end != '\0' || !(factor >= kLeastFactor && factor <= kMostFactor))
    throw Error(fmt::format(
        "--denoise '{}' is no strength: give light, medium, strong, or a factor from {} to {}",
        text, kLeastFactor, kMostFactor));
  return factor;
}

FitOptions with_denoise(FitOptions fit) {
  fit.density_variation = fit.density_variation * denoise_factor(fit.denoise);
  return fit;
}

}  // namespace tomofield::options
