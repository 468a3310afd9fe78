#include "fit/fit.h"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <numeric>
#include <utility>

#include "base/check.h"
#include "base/log.h"
#include "base/random.h"
#include "base/threads/parallel.h"
#include "base/trace.h"
#include "field/vm/factorise.h"
#include "measurement/noise_fit.h"
#include "measurement/surrogate_views.h"
#include "objective/ray_data_term.h"
#include "objective/slab_objective.h"
#include "objective/terms.h"
#include "prior/answer.h"

namespace tomofield::fit {
namespace {

// The bias moves every density at once, so it takes smaller steps than a factor.
constexpr double kBiasRate = 0.02;

// The first moment averages about 20 steps, which is more than the 16 of an epoch. So the noise
// that the views of one subset have and those of others do not have nearly cancels in it.
constexpr AdamOptions kAdam{.beta1 = 0.95};

// Returns a factor on the learning rate. Adam divides by the size of the gradient of a subset. If
// the views are mostly noise, so is that gradient, and what a microscope passes of slow changes
// moves the field by much less than the learning rate says. Plain projections pass slow changes
// fully and keep their rate.
double rate_for_noise(const measurement::Measurement& measurement) {
  if (measurement.transfers.empty()) return 1.0;
  constexpr double kRateOfNoise = 1.5, kMostRate = 10.0;  // docs/results/convergence.md
  const double noise = objective::typical_noise(measurement.noise_sigma);
  return std::clamp(kRateOfNoise * noise / measurement.contrast(), 1.0, kMostRate);
}

// Random streams from here on give the order of an epoch's subsets.
constexpr std::uint64_t kOrderStream = 1000;

FitOptions with_at_most_one_subset_a_view(FitOptions options, int num_views) {
  if (options.engine == Engine::kSlab) options.subsets = std::min(options.subsets, num_views);
  return options;
}

FieldOptions of_kind(FieldOptions options, FieldKind kind) {
  options.kind = kind;
  return options;
}

Domain domain_of(const measurement::Measurement& measurement, const FieldOptions& options) {
  return measurement.ray_geometry ? make_domain(*measurement.ray_geometry, measurement.roi, options)
                                  : make_domain(measurement.geometry, measurement.roi, options);
}

// Returns the domain with the vertices that the first field is made with: those of full resolution,
// or those of the first stage if the fit never comes to full resolution.
Domain with_shapes_for(const FitPart& part, const Stage& first, Domain domain) {
  if (part.num_stages > 0) domain.shapes = domain.shapes_in(domain.tree, first.bin);
  return domain;
}

// Returns the first `num_stages` stages; 0: all.
std::vector<Stage> first_stages(std::vector<Stage> stages, int num_stages) {
  if (num_stages > 0) stages.resize(std::min(stages.size(), static_cast<std::size_t>(num_stages)));
  return stages;
}

// Returns the leaves that a process keeps; an empty list means all.
std::vector<int> leaves_to_keep(const distributed::Communicator& processes,
                                const field::Quadtree& tree, const measurement::RowShare& share,
                                const FitOptions& options) {
  return processes.size() == 1 ? std::vector<int>{}
                               : needed_leaves(tree, share, rows_beyond(options.prior));
}

// Copies the parameters of the leaves that this process keeps. Those of other leaves take no memory
// until they are written.
void copy_kept(const field::Field& field, std::span<const float> from, std::span<float> to) {
  base::parallel_for("copy leaves", field.tree().num_leaves(), [&](std::int64_t i) {
    const int leaf = static_cast<int>(i);
    if (!field.keeps(leaf)) return;
    std::copy(from.begin() + static_cast<std::ptrdiff_t>(field.offset(leaf)),
              from.begin() + static_cast<std::ptrdiff_t>(field.offset(leaf + 1)),
              to.begin() + static_cast<std::ptrdiff_t>(field.offset(leaf)));
  });
}

TreeUpdates make_tree_updates(const FieldOptions& field, const Domain& domain,
                              const FitOptions& options, const Stage& first) {
  if (field.tree == TreeKind::kUniform) return {};
  const auto levels = leaves_by_level(domain.tree);
  const auto num_leaves = std::accumulate(levels.begin(), levels.end(), std::int64_t{0});
  return {std::max(field.leaf_size / 2, static_cast<int>(kernels::kLanes)),
          field.leaf_budget > 0 ? field.leaf_budget : static_cast<int>(num_leaves),
          open_epochs(field, first), options.seed};
}

}  // namespace

Fit::Fit(const measurement::Measurement& measurement, const FieldOptions& field_options,
         const FitOptions& options, const distributed::Communicator& processes, FitPart part)
    : measurement_(measurement),
      processes_(processes),
      options_(with_at_most_one_subset_a_view(options, measurement.num_fitted_views())),
      part_(part),
      stages_(first_stages(make_stages(field_options, options_), part.num_stages)),
      domain_(domain_of(measurement, field_options)),
      share_(measurement::row_share(domain_.num_rows, domain_.tree.roots().cell_size, processes)),
      field_(make_initial_field(with_shapes_for(part, stages_.front(), domain_),
                                measurement.geometry.thickness, measurement.mean_density,
                                of_kind(field_options, stages_.front().field_kind), options.seed,
                                leaves_to_keep(processes, domain_.tree, share_, options_))),
      optimizer_(*field_, kAdam),
      may_change_tree_(field_options.tree != TreeKind::kUniform),
      tree_updates_(make_tree_updates(field_options, domain_, options, stages_.front())),
      fitted_views_(measurement.fitted_views()),
      steps_per_epoch_(options_.subsets) {
  enter_stage();
  if (stage().bin > 1) resample_field();
  for (const double weight : binned_->noise_weights())
    progress_.views.push_back({1.0, 0.0, weight});
  progress_.epoch_sums.resize(progress_.views.size());
  follow_tree();
}

const Stage& Fit::stage_at(std::int64_t step) const {
  const std::int64_t epoch = step / steps_per_epoch();
  return *std::find_if(stages_.rbegin(), stages_.rend(),
                       [&](const Stage& s) { return epoch >= s.first_epoch; });
}

// Returns the share in the current stage. The slabs of coarse pixels are too high to divide bands.
measurement::RowShare Fit::share_of_stage() const {
  return stage().bin == 1 ? share_ : share_.without_help();
}

// Makes the objects that belong to one stage.
void Fit::enter_stage() {
  objective_.reset();
  binned_.reset();  // its successor needs the memory
  binned_ = std::make_unique<measurement::Measurement>(binned(measurement_, stage().bin));
  filters_ = {measurement::view_filters(*binned_), std::nullopt};
  surrogates_.reset();
  follow_noise();
  projector_ = std::make_unique<projection::SlabProjector>(
      binned_->geometry, sample_grid(domain_, measurement_.geometry.thickness, stage().bin));
}

void Fit::free_optimizer() {
  free_moments();
  prior_state_.reset(0);
}

// Frees the gradient and the state of the optimiser, which begins again.
void Fit::free_moments() {
  gradient_.reset(0);
  optimizer_.state() = {};
}

// Resamples the field to the vertices of the stage, or factorises it. The optimiser restarts.
void Fit::resample_field() {
  std::vector<field::LeafShape> shapes = domain_.shapes_in(field_->tree(), stage().bin);
  free_moments();  // before the other field needs memory
  field_ = field_->kind() == stage().field_kind ? field_->resampled(std::move(shapes))
                                                : field::factorised(*field_, std::move(shapes));
  optimizer_ = Adam(*field_, kAdam);
}

// Goes on to a stage of the learned prior, at the same resolution.
void Fit::follow_prior() {
  const std::span<float> parameters = field_->parameters();
  free_moments();  // before the answer needs memory
  if (stage().has_answer) {
    answer();
    copy_kept(*field_, prior_state(), parameters);
    halo_->refresh(parameters);
  } else {
    prior_state_.reset(parameters.size());
    copy_kept(*field_, parameters, prior_state_);
  }
  optimizer_ = Adam(*field_, kAdam);
  follow_tree();
}

// Replaces the state of the prior in the leaves of this process by the answer to it and to the
// field.
void Fit::answer() {
  Halo beyond(*field_, share_.without_help(), prior::kRowsBeyond - field::kPixelCentre,
              processes());
  beyond.refresh(prior_state_);
  beyond.refresh(field_->parameters());
  const prior::Lattice lattice(*field_, measurement_.roi);
  const base::Range own = lattice.rows_of(share_.bands);
  const float mean = prior::mean_density(lattice, own, prior_state(), processes());
  prior::replace_by_answer(prior::Network::trained(), lattice, {own, mean}, prior_state_,
                           field_->parameters());
}

void Fit::restore_prior_state(base::AlignedBuffer<float> state) {
  prior_state_ = std::move(state);
  follow_tree();
}

// Goes from the end of a stage to the start of the next one.
void Fit::refine() {
  const base::TraceSpan span("enter stage");
  if (stage().is_light) return follow_prior();
  const int last_bin = std::prev(&stage())->bin;
  enter_stage();
  resample_field();
  progress_.tree.is_frozen = true;
  const std::vector<double> noise_weights = binned_->noise_weights();
  for (std::size_t v = 0; v < progress_.views.size(); ++v) {
    const measurement::ViewModel& last = progress_.views[v];
    const double longer = static_cast<double>(last_bin) / stage().bin;  // rays are
    progress_.views[v] = {last.scale, last.offset * longer, noise_weights[v]};
  }
  follow_tree();
  halo_->refresh(field_->parameters());  // other vertices depend on more of the old ones
}

// Makes the objects that belong to one tree.
void Fit::follow_tree() {
  gradient_.reset(field_->num_parameters());
  objective_ = std::make_unique<objective::SlabObjective>(objective::SlabObjectiveContext{
      .field = *field_,
      .projector = *projector_,
      .measured = *binned_,
      .full = measurement_,
      .bin = stage().bin,
      .first_row = domain_.first_row,
      .num_rows = domain_.num_rows,
      .support = domain_.support,
      .has_factors = stage().field_kind == stages_.back().field_kind,
      .share = share_of_stage(),
      .own_leaves = own_leaves(),
      .options = options_,
      .processes = processes_,
      .is_light = stage().is_light,
      .answer = stage().has_answer ? prior_state() : std::span<const float>()});
  halo_.emplace(*field_, share_of_stage(), 0.5 * stage().bin, processes());
}

void Fit::keep_views(std::vector<measurement::ViewModel> models) {
  kept_views_ = std::move(models);
  for (std::size_t v = 0; v < progress_.views.size(); ++v) {
    progress_.views[v].scale = kept_views_[v].scale;
    progress_.views[v].offset = kept_views_[v].offset / stage().bin;
  }
}

std::vector<int> Fit::kept_leaves(const field::Quadtree& tree) const {
  return leaves_to_keep(processes(), tree, share_, options_);
}

void Fit::go_on_from(Progress progress, std::unique_ptr<field::Field> field) {
  progress_ = std::move(progress);
  enter_stage();
  field_ = std::move(field);
  optimizer_ = Adam(*field_, kAdam);
  follow_tree();
}

void Fit::go_on_from_stages(const Progress& progress, const field::Field& field) {
  progress_ = progress;
  field_ = field_->resampled(domain_.shapes_in(field_->tree(), std::prev(&stage())->bin));
  const field::Quadtree& tree = field_->tree();
  base::parallel_for("take over leaves", tree.num_leaves(), [&](std::int64_t i) {
    const int leaf = static_cast<int>(i);
    const field::Square& square = tree.leaf(leaf).square;
    const auto middle = [&](std::int64_t first) {
      return static_cast<double>(first) + static_cast<double>(square.size) / 2;
    };
    const int from = field.tree().find_leaf(middle(square.x0), middle(square.y0));
    TOMOFIELD_CHECK(from >= 0 && field.tree().leaf(from).square == square &&
                        field.shape(from) == field_->shape(leaf),
                    "leaves that both fits have");
    std::ranges::copy(
        field.parameters().subspan(field.offset(from), field.offset(from + 1) - field.offset(from)),
        field_->parameters().begin() + std::ptrdiff_t(field_->offset(leaf)));
  });
  field_->bias = field.bias;
  refine();
}

void Fit::reread_measurement() {
  enter_stage();
  follow_tree();
}

double Fit::variation_gain() const { return objective::variation_gain(options_, measurement_); }

std::int64_t Fit::num_epochs() const { return stages_.back().first_epoch + stages_.back().epochs; }

double Fit::work(std::int64_t steps) const {
  double work = 0.0;
  for (const Stage& s : stages_) {
    const std::int64_t first = s.first_epoch * steps_per_epoch();
    const std::int64_t own = std::int64_t{s.epochs} * steps_per_epoch();
    work += static_cast<double>(std::clamp<std::int64_t>(steps - first, 0, own)) * s.step_cost;
  }
  return work;
}

bool Fit::is_done() const {
  if (progress_.step == num_steps()) return true;
  // Earlier stages have other pixels or plain vertices, so their errors do not compare.
  const auto first = static_cast<std::size_t>(stages_.back().first_epoch);
  const std::vector<double>& errors = progress_.held_out_error;
  if (options_.patience == 0 || errors.size() <= first) return false;
  const auto best =
      std::min_element(errors.begin() + static_cast<std::ptrdiff_t>(first), errors.end());
  return errors.end() - best > options_.patience;
}

void Fit::run(const AfterStep& after_step) {
  while (!is_done()) {
    const auto before = processes().traffic();
    take_step();
    ++progress_.step;
    if (progress_.step % steps_per_epoch() == 0) end_epoch();
    const auto after = processes().traffic();
    traffic_.seconds += after.seconds - before.seconds;
    traffic_.bytes += after.bytes - before.bytes;
    ++traffic_.steps;
    // Another run can go on from here to the same bits only if it has the same surrogates.
    const bool may_stop = filters_.empty() || needs_surrogates() || is_done();
    if (may_stop && !after_step(*this)) return;
  }
}

// Returns the views of a step: a subset of interleaved views, which covers the tilt range evenly.
// An epoch visits all subsets in random order. The ray engine compares slabs with no views.
std::vector<int> Fit::views_of_step(std::int64_t step) const {
  std::vector<int> views;
  if (measurement_.ray_geometry) return views;
  const std::int64_t epoch = step / options_.subsets;
  const auto subsets = static_cast<std::size_t>(options_.subsets);
  const std::vector<std::size_t> order = base::shuffled(
      subsets, base::Random(options_.seed, kOrderStream + static_cast<std::uint64_t>(epoch)));
  for (std::size_t i = order[static_cast<std::size_t>(step) % subsets]; i < fitted_views_.size();
       i += subsets)
    views.push_back(fitted_views_[i]);
  return views;
}

double Fit::learning_rate(std::int64_t step) const {
  const Stage& s = stage();
  const double done =
      (static_cast<double>(step) / steps_per_epoch() - static_cast<double>(s.first_epoch)) /
      s.epochs;
  return rate_for_noise(measurement_) * s.first_rate * std::pow(s.last_rate / s.first_rate, done);
}

// Says whether the trace has the tasks of the next step: the second one of each stage. The first
// one also touches new memory.
bool Fit::is_traced_in_detail() const {
  return progress_.step == stage().first_epoch * steps_per_epoch() + 1;
}

// Begins to weight frequencies by the noise when the residuals show it.
void Fit::follow_noise() {
  if (options_.noise_model == NoiseModel::kWhite || filters_.noise || !residuals_are_noise())
    return;
  const measurement::SlabViews::Shape& shape = binned_->rays->shape();
  filters_.noise.emplace(shape.width, shape.num_rows);
  surrogates_.reset();
}

void Fit::take_step() {
  const base::TraceSpan span("step");
  const base::TraceTasks tasks(is_traced_in_detail());
  const std::vector<int> views = views_of_step(progress_.step);
  const double multiplicity =
      static_cast<double>(fitted_views_.size()) / std::max(static_cast<double>(views.size()), 1.0);
  const double rate = learning_rate(progress_.step);
  if (needs_surrogates()) make_surrogates();
  const measurement::SurrogateViews* surrogates = surrogates_ ? &*surrogates_ : nullptr;
  std::vector<measurement::ViewSums> of_surrogates(surrogates ? progress_.views.size() : 0);
  if (surrogates)
    for (const int view : views)
      progress_.epoch_sums[static_cast<std::size_t>(view)] += surrogates->sums(view);
  const double grad_bias = objective_->add_gradient(
      {progress_.step, views, surrogates ? surrogates->models() : progress_.views, multiplicity,
       surrogates},
      gradient_.data(), surrogates ? of_surrogates : progress_.epoch_sums,
      [&](int leaf) { optimizer_.step(*field_, leaf, gradient_, rate); });
  optimizer_.step_bias(*field_, grad_bias, kBiasRate * rate);
  halo_->refresh(field_->parameters());
}

// Moves the vertices of the own leaves back that stand out from their neighbours. This is the
// plug-and-play step of a prior (Venkatakrishnan, Bouman and Wohlberg 2013): total variation makes
// an isolated vertex cheap enough to fit the noise of some rays.
void Fit::limit_spikes() {
  if (stage().has_answer || options_.spike_rank == 0 || field_->kind() != FieldKind::kGrid) return;
  const base::TraceSpan span("limit spikes");
  const base::Range own = own_leaves();
  base::parallel_for("limit spikes", own.size(), [&](std::int64_t i) {
    field_->limit_spikes(own.begin + static_cast<int>(i), options_.spike_rank);
  });
  halo_->refresh(field_->parameters());
}

// Says whether the residuals of the last epoch are those of noise rather than of structure that is
// still to come: in the second half of a fit, at full resolution.
bool Fit::residuals_are_noise() const {
  const std::int64_t epochs_done = progress_.step / steps_per_epoch();
  return stage().bin == 1 && epochs_done > stage().first_epoch && 2 * epochs_done >= num_epochs();
}

// Says whether the transfers of the views take their means away, so that no density explains them.
bool Fit::has_free_offsets() const {
  return std::ranges::any_of(filters_.transfers,
                             [](const auto& transfer) { return !transfer.passes_mean(); });
}

// Fits the models of the views to the sums of an epoch, or takes over what keep_views() gave.
void Fit::fit_views(const std::vector<double>& noise_weights) {
  const bool knows_noise = options_.fit_noise && residuals_are_noise();
  if (!kept_views_.empty()) {
    if (knows_noise) progress_.views = kept_views_;
    return;
  }
  if (knows_noise)
    measurement::fit_noise(noise_weights, fitted_views_, progress_.epoch_sums, progress_.views);
  std::vector<measurement::ViewModel>& views = progress_.views;
  const std::vector<measurement::ViewSums>& sums = progress_.epoch_sums;
  if (options_.fit_view_scale) {
    measurement::fit_nuisances({.has_free_offsets = has_free_offsets()}, sums, views);
  } else if (has_free_offsets()) {
    for (std::size_t v = 0; v < views.size(); ++v)
      views[v].offset = measurement::mean_offset(sums[v], views[v]);
  }
}

void Fit::end_epoch() {
  const std::vector<double> noise_weights = binned_->noise_weights();
  double squares = 0.0, rays = 0.0;
  progress_.view_residual.assign(progress_.views.size(), 0.0);
  for (std::size_t v = 0; v < progress_.views.size(); ++v) {
    const measurement::ViewSums& sums = progress_.epoch_sums[v];
    const double of_view = noise_weights[v] * sums.squared_residual(progress_.views[v]);
    if (sums.n > 0) progress_.view_residual[v] = std::max(of_view, 0.0) / sums.n;
    squares += of_view;
    rays += sums.n;
  }
  progress_.data_loss.push_back(squares / rays);
  fit_views(noise_weights);
  progress_.epoch_sums.assign(progress_.views.size(), {});
  limit_spikes();
  if (part_.scores_epochs && !measurement_.held_out.empty()) score_held_out();
  const std::int64_t epochs_done = progress_.step / steps_per_epoch();
  if (tree_updates_.update(epochs_done, *field_, optimizer_.state(), progress_.tree)) follow_tree();
  if (epochs_done > 0 && epochs_done == stage().first_epoch) refine();
  follow_noise();
}

}  // namespace tomofield::fit
