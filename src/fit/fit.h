#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <utility>
#include <vector>

#include "field/field.h"
#include "fit/adam.h"
#include "fit/domain.h"
#include "fit/halo.h"
#include "fit/options.h"
#include "fit/stages.h"
#include "fit/tree_updates.h"
#include "measurement/held_out.h"
#include "measurement/measurement.h"
#include "measurement/view_residuals.h"
#include "objective/boundary_consistency.h"
#include "objective/fourier_prior.h"
#include "objective/ray_term.h"
#include "objective/slab_objective.h"
#include "projection/slab_projector.h"
#include "projection/slab_sampler.h"

namespace tomofield::fit {

/// The options of the ray engine's data term.
objective::RayTermOptions ray_term_options(const Domain& domain, const FitOptions& options);

/// Where a fit stands between two steps: everything that a resumed run needs
/// beside the field and the optimiser.
struct Progress {
  std::int64_t step = 0;  ///< steps done
  std::vector<measurement::ViewModel> views;
  std::vector<measurement::ViewSums> epoch_sums;  ///< of the running epoch
  std::vector<double> data_loss;  ///< mean squared residual in units of the noise, one an epoch
  TreeProgress tree;
  std::vector<double> held_out_error;  ///< the same of the views held out, if there are any
};

/// The loop of DESIGN §5. With the slab engine, a step uses every slab and one
/// subset of the views; with the ray engine, a random share of the rays of all
/// views, while slabs without views carry the regularisers. With several stages, the field has the
/// vertices, the kind and the steps of one until its epochs are over, and those of the next then.
///
/// Processes that share a fit (Measurement::processes) each work on some bands and keep the
/// parameters of these and of the leaves next to them; what they share otherwise are sums, of
/// which each adds its bands', in one order: the same bits for any number of processes.
class Fit {
 public:
  Fit(const measurement::Measurement& measurement, const FieldOptions& field_options,
      const FitOptions& options);

  /// Called after every step; returning false stops the fit there.
  using AfterStep = std::function<bool(const Fit&)>;
  void run(const AfterStep& after_step);

  std::int64_t num_steps() const;
  /// Whether every step is done, or the held-out error says to stop before (FitOptions::patience).
  bool is_done() const;
  /// Of the field as it is; there must be views held out.
  measurement::HeldOutError held_out_error() const;
  measurement::PredictedView predict_held_out(int view, const measurement::ViewModel& model) const;
  int steps_per_epoch() const;
  std::int64_t num_epochs() const;  ///< of all stages
  const std::vector<Stage>& stages() const { return stages_; }
  /// By how much the density's variation weighs more than its weight over the noise.
  double variation_gain() const;
  /// Of the first `steps` steps, in steps of the last stage (Stage::step_cost).
  double work(std::int64_t steps) const;
  const field::Field& field() const { return *field_; }
  field::Field& field() { return *field_; }
  /// Goes on where another fit of the same options stood; the optimiser starts anew.
  void go_on_from(Progress progress, std::unique_ptr<field::Field> field);
  /// The fitted field, for good: the fit cannot go on afterwards.
  std::unique_ptr<field::Field> take_field() { return std::move(field_); }
  const Adam& optimizer() const { return optimizer_; }
  Adam& optimizer() { return optimizer_; }
  const Progress& progress() const { return progress_; }
  /// The bands that this process works on, and their leaves: all, if it is alone.
  distributed::Range own_bands() const { return bands_; }
  distributed::Range own_leaves() const { return leaves_of_bands(field_->tree(), bands_); }
  /// The leaves of a tree that this process keeps; none: all.
  std::vector<int> kept_leaves(const field::Quadtree& tree) const;
  const distributed::Communicator& processes() const { return *measurement_.processes; }
  /// The steps that run() has taken, and what they had to do with other processes.
  struct Traffic : distributed::Communicator::Traffic {
    std::int64_t steps = 0;
  };
  const Traffic& traffic() const { return traffic_; }

 private:
  std::vector<int> subset_of_step(std::int64_t step) const;
  double learning_rate(std::int64_t step) const;
  void take_step(const std::vector<int>& views);
  std::vector<objective::BandResult> band_gradients(const std::vector<int>& views);
  void share(std::size_t num_views, std::vector<objective::BandResult>& bands) const;
  double sum_of_bands(const std::vector<int>& views,
                      const std::vector<objective::BandResult>& bands);
  double add_ray_gradient();
  void score_held_out();
  void end_epoch();
  const Stage& stage() const;
  void enter_stage();
  void resample_field();
  void refine();
  void follow_tree();

  const measurement::Measurement& measurement_;
  FitOptions options_;
  std::vector<Stage> stages_;
  Domain domain_;
  distributed::Range bands_;
  std::unique_ptr<field::Field> field_;
  Adam optimizer_;
  Progress progress_;
  std::vector<int> fitted_views_;
  base::AlignedBuffer<float> gradient_;
  std::optional<measurement::BinnedMeasurement> binned_;  ///< as the stage sees it
  std::optional<projection::SlabProjector> projector_;
  std::optional<projection::SlabSampler> sampler_;
  std::optional<objective::BoundaryConsistency> boundary_;
  std::optional<objective::FourierPrior> fourier_;
  std::unique_ptr<objective::RayTerm> ray_term_;  ///< of the ray engine
  std::vector<int> touched_leaves_;               ///< the own ones
  std::optional<Halo> halo_;
  TreeUpdates tree_updates_;
  Traffic traffic_;
};

}  // namespace tomofield::fit
