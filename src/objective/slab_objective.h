#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "kernels/total_variation.h"
#include "measurement/slab_views.h"
#include "measurement/view_residuals.h"
#include "projection/slab_projector.h"
#include "projection/slab_sampler.h"

namespace tomofield::objective {

/// Weights of the terms of eq. 9, in noise units: the data term is
/// ½ Σ (residual / σ)², so that one weight serves every size (DESIGN §3).
struct ObjectiveWeights {
  double density_variation = 0.0;
  double factor_variation = 0.0;
  kernels::VariationPenalty density_penalty;
  kernels::VariationPenalty factor_penalty;
  bool backward_x = false, backward_z = false;  ///< direction of the density's differences
};

/// What a pass over a band of slabs found.
struct BandResult {
  std::vector<measurement::ViewSums> views;  ///< one each of the step's views
  double variation = 0.0;                    ///< both total variations, weighted
  double grad_bias = 0.0;
  double boundary_grad_bias = 0.0;  ///< of boundary consistency, which is another pass
};

/// The loss of a band of slabs (one row of root cells) for some of the views,
/// and its gradient. A band writes the gradient of its own leaves alone and
/// reads its neighbours' parameters for halos only, so bands may run in any
/// order and on any thread.
class SlabObjective {
 public:
  SlabObjective(const projection::SlabSampler& sampler, const projection::SlabProjector& projector,
                const measurement::SlabViews& measured, const field::Field& field,
                const ObjectiveWeights& weights);

  /// `multiplicity` scales the views of this step up to the whole series.
  BandResult accumulate_gradient(int band, std::span<const int> views,
                                 std::span<const measurement::ViewModel> models,
                                 double multiplicity, float* gradient) const;

 private:
  struct Workspace;
  template <typename Body>
  void for_each_slab(const projection::SlabSampler::Range& pair, Workspace& w,
                     const Body& body) const;
  void add_data_term(const projection::SlabSampler::Range& pair, std::span<const int> views,
                     std::span<const measurement::ViewModel> models, double multiplicity,
                     Workspace& w, BandResult& result) const;
  void add_variation(int slab, const projection::SlabSampler::Range& pair, const float* samples,
                     float* grad_samples, Workspace& w, BandResult& result) const;
  void start_flux(int slab, Workspace& w) const;
  kernels::DensityRow row_above(int slab, const projection::SlabSampler::Range& pair,
                                std::size_t segment, const Workspace& w) const;
  kernels::DensityRow first_row(const float* samples, std::size_t segment) const;
  kernels::DensityRow decoded_row(const Workspace& w, std::size_t segment) const;
  kernels::SlabVariation variation_of(std::size_t segment) const;

  const projection::SlabSampler& sampler_;
  const projection::SlabProjector& projector_;
  const measurement::SlabViews& measured_;
  const field::Field& field_;
  ObjectiveWeights weights_;
};

}  // namespace tomofield::objective
