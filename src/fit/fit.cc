#include "fit/fit.h"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <numeric>
#include <utility>

#include "base/log.h"
#include "base/parallel.h"
#include "base/random.h"
#include "base/shuffle.h"
#include "field/vm/factorise.h"
#include "kernels/lanes.h"
#include "objective/noise_scale.h"
#include "objective/slab_objective.h"

namespace tomofield::fit {
namespace {

// The bias moves every density at once, so it takes smaller steps than a factor.
constexpr double kBiasRate = 0.02;

// Streams of the seed: one for the starting values, one for each epoch's order, one for
// each step's differences.
constexpr std::uint64_t kOrderStream = 1000;
constexpr std::uint64_t kDirectionStream = std::uint64_t{1} << 40;

double variation_gain_of(const FitOptions& options, const measurement::Measurement& measurement) {
  if (options.penalty != Penalty::kConcave) return 1.0;
  return objective::gain_of_little_noise(objective::typical_noise(measurement.noise_sigma),
                                         measurement.contrast());
}

// The residuals are in units of the noise, so a prior that were the same for
// every series would have one weight there. Total variation is not such a
// prior: what it must suppress is noise, and its best weight grows with the
// noise's deviation rather than its variance (as in denoising, Rudin, Osher and
// Fatemi 1992). Dividing by the noise makes one setting serve every size. `noise` is that of the
// stage's pixels.
objective::ObjectiveWeights objective_weights(const FitOptions& options,
                                              const measurement::Measurement& measurement,
                                              double noise) {
  const double gain = variation_gain_of(options, measurement);
  const double tau = options.penalty == Penalty::kConcave
                         ? objective::concavity(options.concavity, measurement.noise_sigma)
                         : 0.0;
  objective::ObjectiveWeights weights;
  weights.density_variation = gain * options.density_variation / noise;
  weights.factor_variation = options.factor_variation / noise;
  weights.density_penalty.epsilon = static_cast<float>(options.gradient_floor);
  weights.density_penalty.concavity = static_cast<float>(tau);
  weights.factor_penalty = weights.density_penalty;
  return weights;
}

// A jump at a face counts in total variation's units, density times area, and what
// stands out on a Fourier axis as a density times a volume.
objective::BoundaryOptions boundary_options(const FitOptions& options, double noise) {
  objective::BoundaryOptions boundary;
  boundary.weight = options.boundary / noise;
  boundary.seed = options.seed;
  return boundary;
}

objective::FourierPriorOptions fourier_options(const FitOptions& options, double noise) {
  objective::FourierPriorOptions fourier;
  fourier.weight = options.fourier / noise;
  fourier.seed = options.seed;
  fourier.axes.reference = options.fourier_ring;
  return fourier;
}

std::vector<std::vector<int>> leaves_of_bands(const projection::SlabSampler& sampler) {
  std::vector<std::vector<int>> bands;
  for (int band = 0; band < sampler.num_bands(); ++band)
    bands.push_back(sampler.leaves_of_band(band));
  return bands;
}

std::vector<int> views_but(int num_views, const std::vector<int>& held_out) {
  std::vector<int> views;
  for (int v = 0; v < num_views; ++v)
    if (std::ranges::find(held_out, v) == held_out.end()) views.push_back(v);
  return views;
}

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

// None if that is all of them.
std::vector<int> leaves_to_keep(const distributed::Communicator& processes,
                                const field::Quadtree& tree, distributed::Range bands) {
  return processes.size() == 1 ? std::vector<int>{} : needed_leaves(tree, bands);
}

// The structure is open for the first stage, or for this part of the only one.
constexpr double kOpenPart = 0.4;

TreeUpdates make_tree_updates(const FieldOptions& field, const Domain& domain,
                              const FitOptions& options, const Stage& first) {
  if (field.tree == TreeKind::kUniform) return {};
  const auto levels = leaves_by_level(domain.tree);
  const auto num_leaves = std::accumulate(levels.begin(), levels.end(), std::int64_t{0});
  return {std::max(field.leaf_size / 2, static_cast<int>(kernels::kLanes)),
          field.leaf_budget > 0 ? field.leaf_budget : static_cast<int>(num_leaves),
          first.bin > 1 ? first.epochs - 1 : static_cast<std::int64_t>(kOpenPart * first.epochs),
          options.seed};
}

}  // namespace

objective::RayTermOptions ray_term_options(const Domain& domain, const FitOptions& options) {
  return {.roi = domain.roi,
          .support = domain.support,
          .subsets = options.subsets,
          .rays_per_step = options.rays_per_step,
          .ray_samples = options.ray_samples,
          .seed = options.seed};
}

Fit::Fit(const measurement::Measurement& measurement, const FieldOptions& field_options,
         const FitOptions& options)
    : measurement_(measurement),
      options_(with_at_most_one_subset_a_view(options, measurement.num_fitted_views())),
      stages_(make_stages(field_options, options_)),
      domain_(domain_of(measurement, field_options)),
      bands_(measurement::own_bands(domain_.num_rows, domain_.tree.roots().cell_size,
                                    *measurement.processes)),
      field_(make_initial_field(domain_, measurement.geometry.thickness, measurement.mean_density,
                                of_kind(field_options, stages_.front().field_kind), options.seed,
                                leaves_to_keep(*measurement.processes, domain_.tree, bands_))),
      optimizer_(*field_, AdamOptions{}),
      fitted_views_(views_but(measurement.geometry.num_views(), measurement.held_out)),
      tree_updates_(make_tree_updates(field_options, domain_, options, stages_.front())) {
  if (options_.coarse_epochs > 0 && stages_.front().bin == 1 && options_.engine == Engine::kSlab)
    base::log_info(
        "no coarse stage: leaves of this --leaf-size do not end with slabs of coarse pixels");
  enter_stage();
  if (stage().bin > 1) resample_field();
  for (const double sigma : binned_->noise_sigma)
    progress_.views.push_back({1.0, 0.0, 1.0 / (sigma * sigma)});
  progress_.epoch_sums.resize(progress_.views.size());
  follow_tree();
}

const Stage& Fit::stage() const {
  const std::int64_t epoch = progress_.step / steps_per_epoch();
  return *std::find_if(stages_.rbegin(), stages_.rend(),
                       [&](const Stage& s) { return epoch >= s.first_epoch; });
}

// What is made for one stage.
void Fit::enter_stage() {
  binned_.reset();  // before its successor needs memory
  binned_.emplace(measurement_, stage().bin);
  projector_.emplace(binned_->geometry,
                     sample_grid(domain_, measurement_.geometry.thickness, stage().bin));
}

// To the vertices of the stage, or from them to factors; the optimiser starts anew.
void Fit::resample_field() {
  std::vector<field::LeafShape> shapes;
  const field::Quadtree& tree = field_->tree();
  for (int leaf = 0; leaf < tree.num_leaves(); ++leaf)
    shapes.push_back(domain_.shape_in(tree.leaf(leaf).region, stage().bin));
  gradient_.reset(0);  // and the moments go before the other field needs memory
  optimizer_.state() = {};
  field_ = field_->kind() == stage().field_kind ? field_->resampled(std::move(shapes))
                                                : field::factorised(*field_, std::move(shapes));
  optimizer_ = Adam(*field_, AdamOptions{});
}

// From the end of a stage to the start of the next.
void Fit::refine() {
  const int last_bin = std::prev(&stage())->bin;
  enter_stage();
  resample_field();
  progress_.tree.is_frozen = true;
  for (std::size_t v = 0; v < progress_.views.size(); ++v) {
    const double sigma = binned_->noise_sigma[v];
    progress_.views[v].weight = 1.0 / (sigma * sigma);
    progress_.views[v].offset *= static_cast<double>(last_bin) / stage().bin;  // rays are longer
  }
  follow_tree();
  halo_->refresh(*field_);  // other vertices depend on more of the old ones
}

// What is made for one tree.
void Fit::follow_tree() {
  gradient_.reset(field_->num_parameters());
  const int bin = stage().bin;
  sampler_.emplace(*field_, projector_->grid(), domain_.first_row,
                   (domain_.num_rows + bin - 1) / bin, bin);
  // These two count fine pixels: bin² of a face and bin³ of the volume to one of the stage.
  const double noise = objective::typical_noise(binned_->noise_sigma) * bin * bin;
  const auto bands = leaves_of_bands(*sampler_);
  boundary_.emplace(*field_, bands, boundary_options(options_, noise));
  fourier_.emplace(*field_, measurement_.roi, fourier_options(options_, noise * bin), processes(),
                   own_leaves());
  if (measurement_.ray_geometry) {
    ray_term_ = std::make_unique<objective::RayTerm>(*measurement_.ray_geometry, *measurement_.rays,
                                                     *field_, ray_term_options(domain_, options_));
  }
  touched_leaves_.clear();
  for (int band = bands_.begin; band < bands_.end; ++band) {
    const std::vector<int>& leaves = bands[static_cast<std::size_t>(band)];
    touched_leaves_.insert(touched_leaves_.end(), leaves.begin(), leaves.end());
  }
  halo_.emplace(*field_, bands_, bin, processes());
}

std::vector<int> Fit::kept_leaves(const field::Quadtree& tree) const {
  return leaves_to_keep(processes(), tree, bands_);
}

void Fit::go_on_from(Progress progress, std::unique_ptr<field::Field> field) {
  progress_ = std::move(progress);
  enter_stage();
  field_ = std::move(field);
  optimizer_ = Adam(*field_, AdamOptions{});
  follow_tree();
}

double Fit::variation_gain() const { return variation_gain_of(options_, measurement_); }

int Fit::steps_per_epoch() const {
  return ray_term_ ? ray_term_->steps_per_epoch() : options_.subsets;
}

std::int64_t Fit::num_steps() const { return num_epochs() * steps_per_epoch(); }

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
  // Errors of stages before the last are those of other pixels or of plain vertices.
  const auto first = static_cast<std::size_t>(stages_.back().first_epoch);
  const std::vector<double>& errors = progress_.held_out_error;
  if (options_.patience == 0 || errors.size() <= first) return false;
  const auto fine =
      std::ranges::subrange(errors.begin() + static_cast<std::ptrdiff_t>(first), errors.end());
  return fine.end() - std::ranges::min_element(fine) > options_.patience;
}

measurement::HeldOutError Fit::held_out_error() const {
  std::vector<double> weights;
  for (const measurement::ViewModel& view : progress_.views) weights.push_back(view.weight);
  return measurement::held_out_error(*sampler_, *projector_, *binned_->rays, measurement_.held_out,
                                     weights, options_.fit_view_scale, processes());
}

measurement::PredictedView Fit::predict_held_out(int view,
                                                 const measurement::ViewModel& model) const {
  return measurement::predicted_view(*sampler_, *projector_, *binned_->rays, view, model,
                                     processes());
}

void Fit::run(const AfterStep& after_step) {
  while (!is_done()) {
    const auto before = processes().traffic();
    take_step(ray_term_ ? std::vector<int>{} : subset_of_step(progress_.step));
    ++progress_.step;
    if (progress_.step % steps_per_epoch() == 0) end_epoch();
    const auto after = processes().traffic();
    traffic_.seconds += after.seconds - before.seconds;
    traffic_.bytes += after.bytes - before.bytes;
    ++traffic_.steps;
    if (!after_step(*this)) return;
  }
}

// Every subsets-th view, from a first one that visits each residue once an
// epoch in random order: a subset covers the whole tilt range evenly.
std::vector<int> Fit::subset_of_step(std::int64_t step) const {
  const std::int64_t epoch = step / options_.subsets;
  const auto subsets = static_cast<std::size_t>(options_.subsets);
  const std::vector<std::size_t> order = base::shuffled(
      subsets, base::Random(options_.seed, kOrderStream + static_cast<std::uint64_t>(epoch)));
  std::vector<int> views;
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
  return s.first_rate * std::pow(s.last_rate / s.first_rate, done);
}

void Fit::take_step(const std::vector<int>& views) {
  std::vector<objective::BandResult> bands = band_gradients(views);
  share(views.size(), bands);
  double grad_bias = sum_of_bands(views, bands);
  grad_bias += fourier_->accumulate_gradient(progress_.step, gradient_.data()).grad_bias;
  if (ray_term_) grad_bias += add_ray_gradient();
  const double rate = learning_rate(progress_.step);
  optimizer_.step(*field_, touched_leaves_, gradient_, rate);
  optimizer_.step_bias(*field_, grad_bias, kBiasRate * rate);
  halo_->refresh(*field_);
}

// The data term of these views, total variation and boundary consistency of the own bands.
std::vector<objective::BandResult> Fit::band_gradients(const std::vector<int>& views) {
  objective::ObjectiveWeights weights =
      objective_weights(options_, measurement_, objective::typical_noise(binned_->noise_sigma));
  if (stage().field_kind != stages_.back().field_kind)
    weights.factor_variation = 0;  // there are no factors yet
  // Each step looks at edges from another corner: forward differences alone treat
  // their two sides differently.
  base::Random directions(options_.seed,
                          kDirectionStream + static_cast<std::uint64_t>(progress_.step));
  weights.backward_x = directions.below(2) == 1;
  weights.backward_z = directions.below(2) == 1;
  const objective::SlabObjective objective(*sampler_, *projector_, *binned_->rays, *field_,
                                           weights);
  const double multiplicity =
      static_cast<double>(fitted_views_.size()) / std::max(static_cast<double>(views.size()), 1.0);
  std::vector<objective::BandResult> bands(static_cast<std::size_t>(sampler_->num_bands()));
  base::parallel_for(bands_.size(), [&](std::int64_t i) {
    const int band = bands_.begin + static_cast<int>(i);
    objective::BandResult& result = bands[static_cast<std::size_t>(band)];
    result =
        objective.accumulate_gradient(band, views, progress_.views, multiplicity, gradient_.data());
    result.boundary_grad_bias =
        boundary_->accumulate_gradient(band, progress_.step, gradient_.data()).grad_bias;
  });
  return bands;
}

// Every process gets the sums of the others' bands, in one message.
void Fit::share(std::size_t num_views, std::vector<objective::BandResult>& bands) const {
  if (processes().size() == 1) return;
  // Of a band: its views, and after them both gradients of the bias.
  std::vector<measurement::ViewSums> all;
  for (objective::BandResult& band : bands) {
    band.views.resize(num_views);
    all.insert(all.end(), band.views.begin(), band.views.end());
    all.push_back({.n = band.grad_bias, .p = band.boundary_grad_bias});
  }
  measurement::allreduce_sum(processes(), all);
  for (auto from = all.begin(); objective::BandResult & band : bands) {
    std::copy_n(from, num_views, band.views.begin());
    from += static_cast<std::ptrdiff_t>(num_views);
    band.grad_bias = from->n;
    band.boundary_grad_bias = from->p;
    ++from;
  }
}

// In order: the same sums for any number of threads and processes. Returns dL/d bias.
double Fit::sum_of_bands(const std::vector<int>& views,
                         const std::vector<objective::BandResult>& bands) {
  double grad_bias = 0.0, boundary_grad_bias = 0.0;
  for (const objective::BandResult& band : bands) {
    for (std::size_t v = 0; v < views.size(); ++v) {
      progress_.epoch_sums[static_cast<std::size_t>(views[v])] += band.views[v];
    }
    grad_bias += band.grad_bias;
    boundary_grad_bias += band.boundary_grad_bias;
  }
  return grad_bias + boundary_grad_bias;
}

// The data term of this step's rays; returns dL/d bias.
double Fit::add_ray_gradient() {
  const objective::RayTerm::Result result =
      ray_term_->accumulate_gradient(progress_.step, progress_.views, gradient_.data());
  for (std::size_t v = 0; v < result.views.size(); ++v) progress_.epoch_sums[v] += result.views[v];
  return result.grad_bias;
}

void Fit::score_held_out() {
  const measurement::HeldOutError error = held_out_error();
  for (std::size_t i = 0; i < error.views.size(); ++i)
    progress_.views[static_cast<std::size_t>(error.views[i])] = error.models[i];
  progress_.held_out_error.push_back(error.total);
}

void Fit::end_epoch() {
  double squares = 0.0, rays = 0.0;
  for (std::size_t v = 0; v < progress_.views.size(); ++v) {
    squares +=
        progress_.views[v].weight * progress_.epoch_sums[v].squared_residual(progress_.views[v]);
    rays += progress_.epoch_sums[v].n;
  }
  progress_.data_loss.push_back(squares / rays);
  if (options_.fit_view_scale)
    measurement::fit_nuisances(measurement::NuisancePrior{}, progress_.epoch_sums, progress_.views);
  progress_.epoch_sums.assign(progress_.views.size(), {});
  if (!measurement_.held_out.empty()) score_held_out();
  const std::int64_t epochs_done = progress_.step / steps_per_epoch();
  if (tree_updates_.update(epochs_done, *field_, optimizer_.state(), progress_.tree)) follow_tree();
  if (epochs_done > 0 && epochs_done == stage().first_epoch) refine();
}

}  // namespace tomofield::fit
