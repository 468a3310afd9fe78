#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <utility>
#include <vector>

#include "base/range.h"
#include "field/field.h"
#include "fit/adam.h"
#include "fit/domain.h"
#include "fit/halo.h"
#include "fit/options.h"
#include "fit/stages.h"
#include "fit/tree_updates.h"
#include "measurement/held_out.h"
#include "measurement/measurement.h"
#include "objective/objective.h"
#include "projection/slab_projector.h"

namespace tomofield::fit {

/// Where a fit stands between two steps: everything that a resumed run needs beside the field and
/// the optimiser.
struct Progress {
  std::int64_t step = 0;                          ///< steps done
  std::vector<measurement::ViewModel> views;      ///< of every view
  std::vector<measurement::ViewSums> epoch_sums;  ///< of the running epoch, of every view
  std::vector<double> data_loss;  ///< mean squared residual over the noise variance, one an epoch
  TreeProgress tree;
  std::vector<double> held_out_error;  ///< the same of the held-out views, if there are any
};

/// Fits a field to the measured views by minimising an objective (eq. 9) with Adam.
///
/// With the slab engine, a step uses every slab and one subset of the views; with the ray engine, a
/// random part of the rays of all views. A fit passes through stages (stages.h): the field has the
/// vertices, the kind and the learning rates of one stage until its epochs are over, and those of
/// the next stage then.
///
/// Processes that share a fit each work on some bands and keep the parameters of these and of the
/// leaves next to them. They all-reduce sums that each adds for its own bands, in one order: the
/// same bits for any number of processes.
class Fit {
 public:
  /// `measurement` and `processes` must outlive the fit.
  Fit(const measurement::Measurement& measurement, const FieldOptions& field_options,
      const FitOptions& options,
      const distributed::Communicator& processes = distributed::Communicator::alone());

  /// Called after every step; returning false stops the fit there.
  using AfterStep = std::function<bool(const Fit&)>;
  /// Takes steps until the fit is done or `after_step` stops it.
  void run(const AfterStep& after_step);
  /// Continues where another fit of the same options stood; the optimiser starts anew.
  void go_on_from(Progress progress, std::unique_ptr<field::Field> field);

  const Progress& progress() const { return progress_; }
  /// Says whether every step is done, or the held-out error stops the fit before
  /// (FitOptions::patience).
  bool is_done() const;
  int steps_per_epoch() const { return steps_per_epoch_; }
  std::int64_t num_epochs() const;  ///< of all stages
  std::int64_t num_steps() const { return num_epochs() * steps_per_epoch(); }
  const std::vector<Stage>& stages() const { return stages_; }
  /// Returns the work of the first `steps` steps, in steps of the last stage (Stage::step_cost).
  double work(std::int64_t steps) const;

  /// Returns how many times its usual weight the density's variation has (objective/terms.h).
  double variation_gain() const;
  /// Scores the field as it is on the held-out views, of which there must be some.
  measurement::ViewErrors held_out_error() const;
  measurement::PredictedView predict_held_out(int view, const measurement::ViewModel& model) const;

  const field::Field& field() const { return *field_; }
  field::Field& field() { return *field_; }
  /// Hands over the fitted field; the fit cannot go on afterwards.
  std::unique_ptr<field::Field> take_field() { return std::move(field_); }
  const Adam& optimizer() const { return optimizer_; }
  Adam& optimizer() { return optimizer_; }

  const distributed::Communicator& processes() const { return processes_; }
  /// Returns the bands that this process works on: all of them, if it is alone.
  base::Range own_bands() const { return bands_; }
  base::Range own_leaves() const { return leaves_of_bands(field_->tree(), bands_); }
  /// Returns the leaves of a tree that this process keeps; none: all.
  std::vector<int> kept_leaves(const field::Quadtree& tree) const;
  /// Counts the steps that run() has taken, and their messages to other processes.
  struct Traffic : distributed::Communicator::Traffic {
    std::int64_t steps = 0;
  };
  const Traffic& traffic() const { return traffic_; }

 private:
  void take_step();
  void end_epoch();
  void score_held_out();
  std::vector<int> views_of_step(std::int64_t step) const;
  double learning_rate(std::int64_t step) const;
  const Stage& stage() const;
  void enter_stage();
  void resample_field();
  void refine();
  void follow_tree();

  const measurement::Measurement& measurement_;
  const distributed::Communicator& processes_;
  FitOptions options_;
  std::vector<Stage> stages_;
  Domain domain_;
  base::Range bands_;
  std::unique_ptr<field::Field> field_;
  Adam optimizer_;
  TreeUpdates tree_updates_;
  Progress progress_;
  std::vector<int> fitted_views_;
  int steps_per_epoch_;

  // Belongs to one stage or one tree. The objective refers to the first two, so they keep their
  // place when a fit is moved.
  std::unique_ptr<measurement::Measurement> binned_;
  std::unique_ptr<projection::SlabProjector> projector_;
  std::unique_ptr<objective::Objective> objective_;
  base::AlignedBuffer<float> gradient_;
  std::optional<Halo> halo_;
  Traffic traffic_;
};

}  // namespace tomofield::fit
