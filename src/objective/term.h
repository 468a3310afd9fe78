#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "base/range.h"
#include "distributed/communicator.h"
#include "field/field.h"
#include "geometry/ray_geometry.h"
#include "measurement/measurement.h"
#include "measurement/surrogate_views.h"
#include "measurement/view_residuals.h"
#include "projection/slab_projector.h"
#include "projection/slab_sampler.h"
#include "tomofield/options.h"

namespace tomofield::objective {

/// One step of a fit, as the terms of the loss see it.
struct Step {
  std::int64_t number = 0;                         ///< counted from the first step of the fit
  std::span<const int> views;                      ///< views that the slabs are compared with
  std::span<const measurement::ViewModel> models;  ///< of every view of the series
  double multiplicity = 1.0;  ///< scales the step's views up to the whole series
  /// What the step's views are compared with in place of the measured rays; null: these rays.
  const measurement::SurrogateViews* surrogates = nullptr;
};

/// A pair of consecutive slabs of one band, or the last slab of an odd number: decoded samples, and
/// the gradient of the loss by them. Slabs follow each other in memory, projector.grid().size()
/// floats each.
struct SlabBatch {
  const projection::SlabSampler& sampler;
  const projection::SlabProjector& projector;
  const projection::ViewCrossings& crossings;  ///< of the step's views
  base::Range slabs;                           ///< counted over the whole volume
  bool begins_band = false;
  float* all_samples = nullptr;
  float* all_gradients = nullptr;

  float* samples(int slab) const { return all_samples + offset(slab); }
  float* gradient(int slab) const { return all_gradients + offset(slab); }

 private:
  std::size_t offset(int slab) const {
    return static_cast<std::size_t>(slab - slabs.begin) * projector.grid().size();
  }
};

/// A part of the loss and its derivative by the field's bias.
struct TermValue {
  double value = 0.0;
  double grad_bias = 0.0;

  TermValue& operator+=(const TermValue& other) {
    value += other.value;
    grad_bias += other.grad_bias;
    return *this;
  }
};

/// A term of the loss (eq. 9). It adds its value and its gradient where that is cheapest: to
/// decoded samples of slabs, to the parameters of leaves, or to the whole field at once.
/// add_slabs() and add_field() work on all threads, in pieces that do not depend on their number.
/// Objects hold no state of a step.
class Term {
 public:
  virtual ~Term() = default;

  /// A term keeps this for add_slabs() from one batch of a band to the next.
  struct Scratch {
    virtual ~Scratch() = default;
    /// Returns what the next batch of the band depends on. Another process may go on from a copy.
    virtual std::span<float> carried() { return {}; }
  };
  /// Makes the scratch of one band.
  virtual std::unique_ptr<Scratch> make_scratch(const projection::SlabSampler& /*sampler*/) const {
    return std::make_unique<Scratch>();
  }

  /// Returns true if add_slabs() replaces the batch's gradient, which then need not be cleared.
  /// Only the first term may do so.
  virtual bool replaces_gradient() const { return false; }
  /// Adds the term of a batch of slabs: its gradient by the samples to batch.gradient(), sums of
  /// residuals to `view_sums` (one each of step.views). Returns its value. The batches of a band
  /// come in order and with the same `scratch`. Several bands may be worked on at the same time.
  virtual double add_slabs(const Step& /*step*/, const SlabBatch& /*batch*/, Scratch* /*scratch*/,
                           std::span<measurement::ViewSums> /*view_sums*/) const {
    return 0.0;
  }
  /// The work of a term on some leaves in one step.
  class LeafPass {
   public:
    virtual ~LeafPass() = default;
    /// Returns the number of readings: work that reads the parameters of any leaves.
    virtual std::int64_t num_readings() const { return 0; }
    /// Does a reading. All are done before the parameters change; different ones may be done at the
    /// same time.
    virtual void read(std::int64_t /*index*/) {}
    /// Adds the gradient by the parameters of leaf number `index` to `gradient` (all parameters).
    /// It comes after the readings, reads no parameters but those of the leaf, and may be called
    /// for different leaves at the same time. Returns the term of the leaf.
    virtual TermValue add_leaf(std::size_t index, float* gradient) = 0;
  };
  /// Begins the work on `leaves`, which are ascending and outlive it. Returns nothing if the term
  /// has no part that belongs to leaves.
  virtual std::unique_ptr<LeafPass> leaf_pass(const Step& /*step*/,
                                              std::span<const int> /*leaves*/) const {
    return nullptr;
  }
  /// Adds the gradient by the parameters of all leaves of this process. Sums of residuals go to
  /// `view_sums` (one for every view). Every process calls it.
  virtual TermValue add_field(const Step& /*step*/, float* /*gradient*/,
                              std::span<measurement::ViewSums> /*view_sums*/) const {
    return {};
  }
};

/// Terms are made from a field on one tree and the views at the resolution of one stage.
struct TermContext {
  const field::Field& field;
  const projection::SlabSampler& sampler;
  const measurement::Measurement& measured;  ///< in pixels of the stage
  const measurement::Measurement& full;      ///< at full resolution
  int bin = 1;                               ///< pixels of `full` in one of the stage, on an axis
  geometry::Extent2 support;                 ///< where densities count
  bool has_factors = true;                   ///< the field has the factors that were asked for
  base::Range own_leaves;                    ///< leaves of this process
  const FitOptions& options;
  const distributed::Communicator& processes = distributed::Communicator::alone();
  bool is_light = false;               ///< the stage has little total variation (Stage::is_light)
  std::span<const float> answer = {};  ///< of the learned prior, if the stage is pulled towards one
};

}  // namespace tomofield::objective
