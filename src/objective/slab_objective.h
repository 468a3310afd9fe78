#pragma once

#include <memory>
#include <vector>

#include "base/aligned_buffer.h"
#include "distributed/communicator.h"
#include "distributed/partition.h"
#include "objective/objective.h"

namespace tomofield::objective {

/// What a slab objective is made for.
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
  base::Range own_leaves;                      ///< and their leaves
  const ObjectiveOptions& options;
  const distributed::Communicator& processes = distributed::Communicator::alone();
};

/// Evaluates the terms over batches of slabs on this machine's cores: a band (one row of root
/// cells) is one piece of work. A band writes the gradient of its own leaves alone and only reads
/// its neighbours' parameters, so bands may run in any order and on any thread. All that the
/// context names must outlive the objective; it is made anew when the tree or the stage changes.
class SlabObjective : public Objective {
 public:
  explicit SlabObjective(const SlabObjectiveContext& context);
  /// Evaluates these terms in place of the usual ones.
  SlabObjective(const SlabObjectiveContext& context, std::vector<std::unique_ptr<Term>> terms);

  double add_gradient(const Step& step, float* gradient,
                      std::span<measurement::ViewSums> view_sums) const override;
  const std::vector<int>& own_leaves() const override { return own_leaves_; }
  measurement::ViewErrors held_out_error(std::span<const double> noise_weight,
                                         bool fit_view_scale) const override;
  measurement::PredictedView predict(int view, const measurement::ViewModel& model) const override;

  const projection::SlabSampler& sampler() const { return sampler_; }

  /// What a pass over a band found.
  struct BandSums {
    std::vector<measurement::ViewSums> views;  ///< one each of the step's views
    double slab_grad_bias = 0.0;               ///< dL/d bias through the samples of slabs
    std::vector<TermValue> terms;              ///< one each; grad_bias from Term::add_band alone
  };
  /// Adds the gradient of the band's own leaves to `gradient` (all parameters).
  BandSums add_band(const Step& step, int band, float* gradient) const;

 private:
  struct Workspace;
  void add_batch(const Step& step, const SlabBatch& batch, float* gradient, BandSums& sums) const;
  void share(std::vector<BandSums>& bands) const;

  const projection::SlabProjector& projector_;
  const measurement::Measurement& measured_;
  projection::SlabSampler sampler_;
  const distributed::Communicator& processes_;
  base::Range own_bands_;
  std::vector<int> own_leaves_;
  std::vector<std::unique_ptr<Term>> terms_;
};

}  // namespace tomofield::objective
