#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "base/range.h"
#include "field/field.h"
#include "fit/adam.h"
#include "fit/domain.h"
#include "fit/halo.h"
#include "fit/stages.h"
#include "fit/tree_updates.h"
#include "measurement/held_out.h"
#include "measurement/measurement.h"
#include "measurement/row_share.h"
#include "measurement/surrogate_views.h"
#include "objective/objective.h"
#include "projection/slab_projector.h"
#include "tomofield/options.h"

namespace tomofield::fit {

/// The state of a fit between two steps, apart from the field and the optimiser. A resumed run
/// continues from these three.
struct Progress {
  std::int64_t step = 0;                          ///< number of steps done
  std::vector<measurement::ViewModel> views;      ///< models of each view
  std::vector<measurement::ViewSums> epoch_sums;  ///< sums of each view in the current epoch
  std::vector<double> data_loss;  ///< of each epoch: mean squared residual over the noise variance
  /// The same of each view in the last whole epoch; 0 for a view without rays that count, such as a
  /// held-out one. Empty before the end of the first epoch.
  std::vector<double> view_residual;
  TreeProgress tree;
  std::vector<double> held_out_error;  ///< of each epoch: the same of the held-out views, if any
};

/// The part of a fit that is made.
struct FitPart {
  int num_stages = 0;         ///< of make_stages(), from the first one on; 0: all
  bool scores_epochs = true;  ///< score the held-out views after each epoch
};

/// Fits a field to the measured views: it minimises an objective (eq. 9) with Adam.
///
/// An epoch uses every ray that counts once. With the slab engine, a step uses all slabs and one
/// subset of the views. With the ray engine, it uses a random part of the rays of all views. After
/// each epoch the fit solves for the scales of the views, scores the held-out views and updates an
/// adaptive tree, as far as the options ask for it.
///
/// A fit goes through stages (stages.h). At the end of a stage, the field is resampled to the
/// vertices of the next one, or factorised, and the optimiser starts again.
///
/// Several processes can share a fit. Each works on some rows and keeps the parameters of their
/// leaves and of the leaves next to them. Sums over bands are all-reduced in a fixed order, so the
/// result has the same bits for any number of threads and processes.
class Fit {
 public:
  /// Makes the initial field. `measurement` and `processes` must outlive the fit.
  Fit(const measurement::Measurement& measurement, const FieldOptions& field_options,
      const FitOptions& options,
      const distributed::Communicator& processes = distributed::Communicator::alone(),
      FitPart part = {});

  /// Keeps the views at these models, which another fit found in pixels of full resolution, instead
  /// of fitting any. Scales and offsets hold from now on. Weights and largest residuals hold from
  /// the second half of the fit on, as those that a fit finds itself. Call it before the first
  /// step, and before go_on_from().
  void keep_views(std::vector<measurement::ViewModel> models);

  /// Is called after every step; returning false stops the fit. If the views are filtered by a
  /// microscope, it is called where the fit is about to make new surrogates of them.
  using AfterStep = std::function<bool(const Fit&)>;
  /// Takes steps until the fit is done or `after_step` stops it.
  void run(const AfterStep& after_step);
  /// Returns the last number of steps below `step` after which run() can stop.
  std::int64_t last_stop_before(std::int64_t step) const;
  /// Returns why a tree, or a progress and a field, that were read from a file are no state of this
  /// fit, or an empty text if they are one.
  std::string fault_of(const field::Quadtree& tree) const;
  std::string fault_of(const Progress& progress, const field::Field& field) const;
  /// Takes over the progress and the field of another fit with the same options, which must have no
  /// fault. The optimiser starts again; the caller can restore its state.
  void go_on_from(Progress progress, std::unique_ptr<field::Field> field);

  /// Goes on where another fit has ended, which has the first stages of this one
  /// (FitPart::num_stages) and its rows among others: takes over its models of the views, and
  /// the vertices of those of its leaves that this fit has as well. Call it before the first step.
  void go_on_from_stages(const Progress& progress, const field::Field& field);

  /// Takes over rays and tilt angles of the measurement that the caller has replaced between two
  /// steps. Field, optimiser and models of the views stay.
  void reread_measurement();

  const Progress& progress() const { return progress_; }
  /// Returns true if every step is done, or the held-out error has not improved for
  /// FitOptions::patience epochs.
  bool is_done() const;
  int steps_per_epoch() const { return steps_per_epoch_; }
  /// Returns the number of epochs of all stages.
  std::int64_t num_epochs() const;
  std::int64_t num_steps() const { return num_epochs() * steps_per_epoch(); }
  const std::vector<Stage>& stages() const { return stages_; }
  /// Returns the stage of the next step.
  const Stage& stage() const { return stage_at(progress_.step); }
  /// Returns the estimated work of the first `steps` steps, in steps of the last stage
  /// (Stage::step_cost).
  double work(std::int64_t steps) const;

  /// Returns the factor on the weight of the density's variation (objective/terms.h).
  double variation_gain() const;
  /// Scores the current field on the held-out views. There must be at least one.
  measurement::ViewErrors held_out_error() const { return held_out_error(options_.fit_view_scale); }
  /// Does the same, with a scale and an offset of each view if `fit_view_scale`, whatever the
  /// options say.
  measurement::ViewErrors held_out_error(bool fit_view_scale) const;
  /// The score of the held-out views and their predictions, scaled by the models of the score.
  struct HeldOut {
    measurement::ViewErrors errors;
    std::vector<measurement::PredictedView> views;
  };
  /// Does the same, and returns the predictions as well, which are made once. All of them are in
  /// memory together.
  HeldOut predict_held_out(bool fit_view_scale) const;
  /// Predicts some views, each scaled by its model, beside the measured ones. All of them are in
  /// memory together.
  std::vector<measurement::PredictedView> predict(
      std::span<const int> views, std::span<const measurement::ViewModel> models) const;

  /// Does the same without what the microscope does to the projections, and without models.
  std::vector<measurement::PredictedView> project(std::span<const int> views) const;

  const field::Field& field() const { return *field_; }
  field::Field& field() { return *field_; }
  /// Hands over the fitted field; the fit cannot go on afterwards.
  std::unique_ptr<field::Field> take_field() { return std::move(field_); }
  /// Frees what only steps need: the gradient, the state of the optimiser and that of the learned
  /// prior. The fit cannot take steps afterwards.
  void free_optimizer();
  const Adam& optimizer() const { return optimizer_; }
  Adam& optimizer() { return optimizer_; }

  /// Returns what the stages of the learned prior keep beside the field, with its places: the
  /// parameters at the start of the light stage, and in the last stage the answer. Empty before.
  std::span<const float> prior_state() const { return prior_state_; }
  /// Restores it after go_on_from().
  void restore_prior_state(base::AlignedBuffer<float> state);

  const distributed::Communicator& processes() const { return processes_; }
  /// Returns the rows that this process works on; one process alone has all of them.
  const measurement::RowShare& share() const { return share_; }
  /// Returns the rows that all processes work on.
  std::int64_t num_rows() const { return domain_.num_rows; }
  /// Returns the leaves of its bands.
  base::Range own_leaves() const { return field::leaves_of_bands(field_->tree(), share_.bands); }
  /// Returns the leaves of a tree whose parameters this process keeps; an empty list means all.
  std::vector<int> kept_leaves(const field::Quadtree& tree) const;
  /// Counts the steps that run() has taken and their messages to other processes.
  struct Traffic : distributed::Communicator::Traffic {
    std::int64_t steps = 0;
  };
  const Traffic& traffic() const { return traffic_; }

 private:
  void follow_noise();
  int steps_of_surrogates() const;
  bool needs_surrogates() const;
  bool has_free_offsets() const;
  void make_surrogates();
  void take_step();
  bool is_traced_in_detail() const;
  void end_epoch();
  void fit_views(const std::vector<double>& noise_weights);
  bool residuals_are_noise() const;
  void limit_spikes();
  void score_held_out();
  measurement::ViewErrors errors_of(std::vector<measurement::ViewSums> held_out,
                                    bool fit_view_scale) const;
  std::vector<int> views_of_step(std::int64_t step) const;
  double learning_rate(std::int64_t step) const;
  const Stage& stage_at(std::int64_t step) const;
  measurement::RowShare share_of_stage() const;
  void enter_stage();
  void free_moments();
  void resample_field();
  void follow_prior();
  void answer();
  void refine();
  void follow_tree();

  const measurement::Measurement& measurement_;
  const distributed::Communicator& processes_;
  FitOptions options_;
  FitPart part_;
  std::vector<Stage> stages_;
  base::AlignedBuffer<float> prior_state_;  // prior_state()
  Domain domain_;
  measurement::RowShare share_;
  std::unique_ptr<field::Field> field_;
  Adam optimizer_;
  bool may_change_tree_;
  TreeUpdates tree_updates_;
  Progress progress_;
  std::vector<int> fitted_views_;
  std::vector<measurement::ViewModel> kept_views_;  // empty: the fit finds its own
  int steps_per_epoch_;

  // These belong to one stage or one tree and are made again for the next. The objective refers to
  // the first two, so they must stay where they are when a fit is moved.
  std::unique_ptr<measurement::Measurement> binned_;
  measurement::DataFilters filters_;
  std::optional<measurement::SurrogateViews> surrogates_;  // of the next steps
  std::unique_ptr<projection::SlabProjector> projector_;
  std::unique_ptr<objective::Objective> objective_;
  base::AlignedBuffer<float> gradient_;
  std::optional<Halo> halo_;
  Traffic traffic_;
};

/// Returns about the memory that a fit to filtered views takes for their surrogates
/// (measurement/surrogate_views.h): the rays of the process's `own` rows, the projections of `all`
/// rows that they are made from, the filters, and what each thread needs to filter a view.
std::size_t surrogate_memory(const measurement::SlabViews::Shape& own,
                             const measurement::SlabViews::Shape& all, int steps_an_epoch,
                             int slabs_in_use);

}  // namespace tomofield::fit
