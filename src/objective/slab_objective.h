#pragma once

#include <functional>
#include <map>
#include <memory>
#include <span>
#include <vector>

#include "base/range.h"
#include "base/threads/pool.h"
#include "distributed/communicator.h"
#include "measurement/row_share.h"
#include "objective/objective.h"

namespace tomofield::objective {

/// The field, the views and the options of a slab objective.
struct SlabObjectiveContext {
  const field::Field& field;
  const projection::SlabProjector& projector;  ///< of the stage's pixels
  const measurement::Measurement& measured;    ///< in pixels of the stage
  const measurement::Measurement& full;        ///< at full resolution
  int bin = 1;                                 ///< pixels of `full` in one of the stage, on an axis
  std::int64_t first_row = 0, num_rows = 0;    ///< of the slabs, in pixels of `full`
  geometry::Extent2 support;                   ///< where densities count
  bool has_factors = true;                     ///< the field has the factors that were asked for
  measurement::RowShare share;                 ///< rows of this process, in pixels of `full`
  base::Range own_leaves;                      ///< leaves of its bands
  const FitOptions& options;
  const distributed::Communicator& processes = distributed::Communicator::alone();
  bool is_light = false;               ///< the stage has little total variation (Stage::is_light)
  std::span<const float> answer = {};  ///< of the learned prior, if the stage is pulled towards one
};

/// Evaluates the terms on batches of slabs with the cores of this machine. A task works on the
/// slabs of one band (a row of root cells); threads that have no band help with the parts of one. A
/// band writes the gradient of its own leaves alone and only reads the parameters of its
/// neighbours. A leaf adds up its slabs in order, so threads change no bit. If a process works on
/// the first slabs of another one's band, it begins with them and hands over what it found; the
/// owner goes on from there at last. Everything that the context refers to must outlive the
/// objective. A new tree or stage needs a new objective.
class SlabObjective : public Objective {
 public:
  explicit SlabObjective(const SlabObjectiveContext& context);
  /// Evaluates these terms in place of the usual ones.
  SlabObjective(const SlabObjectiveContext& context, std::vector<std::unique_ptr<Term>> terms);

  ~SlabObjective() override;

  double add_gradient(const Step& step, float* gradient, std::span<measurement::ViewSums> view_sums,
                      const LeafDone& leaf_done) const override;
  measurement::ViewErrors held_out_error(std::span<const double> noise_weight,
                                         bool fit_view_scale) const override;
  std::vector<measurement::PredictedView> predict(
      std::span<const int> views, std::span<const measurement::ViewModel> models) const override;

  const projection::SlabSampler& sampler() const { return sampler_; }

  /// The sums of a pass over a pair of slabs.
  struct PairSums {
    std::vector<measurement::ViewSums> views;  ///< one for each view of the step
    std::vector<TermValue> terms;              ///< Term::add_slabs() of each term; values alone
    double grad_bias = 0.0;                    ///< dL/d bias through the samples
  };
  /// The sums of all slabs and of all leaves.
  struct Sums {
    std::vector<PairSums> pairs;                ///< in the order of the slabs
    std::vector<std::vector<TermValue>> bands;  ///< of the leaves, for each term [band][term]
    TermValue field;                            ///< Term::add_field() of all terms
  };
  /// Does what add_gradient() does, and returns the sums. Every process has the sums of all, but
  /// values only of its own part.
  Sums add(const Step& step, float* gradient, std::span<measurement::ViewSums> view_sums,
           const LeafDone& leaf_done) const;

 private:
  struct Workspace;
  struct Pass;
  void add_slabs(const Pass& pass, int band, base::Range slabs, Workspace& workspace) const;
  void add_batch(const Pass& pass, const SlabBatch& batch, Workspace& workspace,
                 PairSums& sums) const;
  void add_bands(const Pass& pass) const;
  void add_leaves(const Pass& pass, const LeafDone& leaf_done) const;
  std::shared_ptr<const projection::ViewCrossings> crossings_of(std::span<const int> views) const;
  distributed::Communicator::Sending add_slabs_of_next(const Pass& pass) const;
  void go_on_from_previous(const Pass& pass) const;
  void for_each_handed_over(base::Range slabs, Workspace& workspace, float* gradient,
                            const std::function<void(std::span<float>)>& body) const;
  void allreduce(Sums& sums) const;

  const field::Field& field_;
  const projection::SlabProjector& projector_;
  const measurement::Measurement& measured_;
  projection::SlabSampler sampler_;
  const distributed::Communicator& processes_;
  base::Range own_bands_;
  base::Range slabs_for_next_, slabs_by_previous_;
  std::vector<int> pair_of_slab_;
  std::vector<int> own_leaves_;
  std::vector<std::unique_ptr<Term>> terms_;
  mutable base::Pool<Workspace> workspaces_;
  // Keeps the crossings of every list of views that a step had: each list comes again in every
  // epoch.
  mutable std::map<std::vector<int>, std::shared_ptr<const projection::ViewCrossings>> crossings_;
};

}  // namespace tomofield::objective
