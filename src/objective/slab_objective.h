#pragma once

#include <memory>
#include <vector>

#include "base/pool.h"
#include "base/range.h"
#include "distributed/communicator.h"
#include "distributed/partition.h"
#include "objective/objective.h"

namespace tomofield::objective {

/// Holds the field, the views and the options of a slab objective.
struct SlabObjectiveContext {
  const field::Field& field;
  const projection::SlabProjector& projector;  ///< of the stage's pixels
  const measurement::Measurement& measured;    ///< in pixels of the stage
  const measurement::Measurement& full;        ///< at full resolution
  int bin = 1;                                 ///< pixels of `full` in one of the stage, on an axis
  std::int64_t first_row = 0, num_rows = 0;    ///< of the slabs, in pixels of `full`
  geometry::Extent2 support;                   ///< where densities count
  bool has_factors = true;                     ///< the field has the factors that were asked for
  base::Range own_bands;                       ///< bands of this process
  base::Range own_leaves;                      ///< leaves of these bands
  const ObjectiveOptions& options;
  const distributed::Communicator& processes = distributed::Communicator::alone();
};

/// Evaluates the terms on batches of slabs with the cores of this machine. A task works on the
/// slabs of one band (a row of root cells); threads that have no band help with the parts of one. A
/// band writes the gradient of its own leaves alone and only reads the parameters of its
/// neighbours. A leaf adds up its slabs in order, so threads change no bit. Everything that the
/// context refers to must outlive the objective. A new tree or stage needs a new objective.
class SlabObjective : public Objective {
 public:
  explicit SlabObjective(const SlabObjectiveContext& context);
  /// Evaluates these terms in place of the usual ones.
  SlabObjective(const SlabObjectiveContext& context, std::vector<std::unique_ptr<Term>> terms);

  ~SlabObjective() override;

  double add_gradient(const Step& step, float* gradient,
                      std::span<measurement::ViewSums> view_sums) const override;
  const std::vector<int>& own_leaves() const override { return own_leaves_; }
  measurement::ViewErrors held_out_error(std::span<const double> noise_weight,
                                         bool fit_view_scale) const override;
  measurement::PredictedView predict(int view, const measurement::ViewModel& model) const override;

  const projection::SlabSampler& sampler() const { return sampler_; }

  /// Holds the sums of a pass over a band.
  struct BandSums {
    std::vector<measurement::ViewSums> views;  ///< one for each view of the step
    double slab_grad_bias = 0.0;               ///< dL/d bias through the samples of slabs
    std::vector<TermValue> terms;  ///< one for each term; grad_bias from Term::add_leaves alone
  };
  /// Adds the gradient of the own leaves, but for Term::add_field(), to `gradient` (all
  /// parameters). Returns the sums of all bands, complete on every process.
  std::vector<BandSums> add_bands(const Step& step, float* gradient) const;

 private:
  struct Workspace;
  void add_slabs(const Step& step, int band, const projection::ViewCrossings& crossings,
                 float* gradient, BandSums& sums) const;
  void add_batch(const Step& step, const SlabBatch& batch, Workspace& workspace, float* gradient,
                 BandSums& sums) const;
  void add_leaves(const Step& step, float* gradient, std::vector<BandSums>& bands) const;
  void allreduce(std::vector<BandSums>& bands) const;

  const field::Field& field_;
  const projection::SlabProjector& projector_;
  const measurement::Measurement& measured_;
  projection::SlabSampler sampler_;
  const distributed::Communicator& processes_;
  base::Range own_bands_;
  std::vector<int> own_leaves_;
  std::vector<std::unique_ptr<Term>> terms_;
  mutable base::Pool<Workspace> workspaces_;
};

}  // namespace tomofield::objective
