#pragma once

#include <cstdint>
#include <limits>
#include <span>
#include <vector>

#include "distributed/communicator.h"

namespace tomofield::measurement {

/// The relation of a view's measurement to the predicted line integrals p:
/// measured ≈ scale · p + offset, with noise of variance 1 / weight.
struct ViewModel {
  double scale = 1.0;
  double offset = 0.0;
  double weight = 1.0;
  /// A residual has at most this size in the gradient, whose loss is Huber's (1964): quadratic up
  /// to here, then linear.
  double largest_residual = std::numeric_limits<double>::infinity();
};

/// Sums over the rays of a view that count, p predicted and b measured. The loss is reported
/// from them, and the closed-form nuisances are solved from them.
struct ViewSums {
  double n = 0, p = 0, b = 0, pp = 0, pb = 0, bb = 0;
  /// Sum of the squared residuals, of which none counts as larger than ViewModel::largest_residual.
  double limited_squares = 0;
  ViewSums& operator+=(const ViewSums& other);
  /// Returns Σ (scale p + offset − b)².
  double squared_residual(const ViewModel& model) const;
};
/// Completes sums on all processes (Communicator::allreduce_sum); each element is nonzero on one.
void allreduce_sum(const distributed::Communicator& processes, std::span<ViewSums> sums);

/// Differentiates the data loss of one view of a slab, ½ · weight · Σ mask (scale p + offset − b)²,
/// or less than that for residuals larger than the model's limit. `rays` holds p [x, lane] and is
/// overwritten by multiplicity · dL/dp; multiplicity scales a subset of the views up to all of
/// them. Masked rays get 0. Returns the sums.
ViewSums data_term(const ViewModel& model, double multiplicity, const float* measured,
                   const std::uint16_t* mask, std::int64_t width, float* rays);

/// Does the same for a single ray that counts: adds it to the sums of its view and
/// returns multiplicity · dL/dp.
double ray_data_term(const ViewModel& model, double multiplicity, double measured, double predicted,
                     ViewSums& sums);

/// Per-view scale and offset follow in closed form from least squares with a shrinkage
/// prior worth `shrinkage` times the view's own rays,
///
///   min  w Σ (a p + o − b)² + shrinkage · w (Σ p² (a − 1)² + n o²).
///
/// Without it an extended slab's laterally constant part could stay in free
/// offsets; with it each fit leaves a share of the residual to the density,
/// which takes it over in the course of the epochs. Afterwards Σ log scale = 0.
///
/// A contrast transfer passes so little of the mean of a projection that the density cannot take it
/// over. Then offsets are free, and p in the prior is the difference from its mean.
struct NuisancePrior {
  double shrinkage = 0.1;
  bool has_free_offsets = false;
};
void fit_nuisances(const NuisancePrior& prior, const std::vector<ViewSums>& sums,
                   std::vector<ViewModel>& views);

/// Returns the offset with which a view's predictions have the mean of the measurements, with the
/// scale of `model`; 0 without rays.
double mean_offset(const ViewSums& sums, const ViewModel& model);

/// The errors with which a field predicts views.
struct ViewErrors {
  std::vector<int> views;
  std::vector<ViewModel> models;   ///< [i]: the model that views[i] was scored with
  std::vector<double> view_error;  ///< [i]: mean squared residual over the noise variance
  double total = 0;                ///< the same over all of their rays
};

/// Sums of some views over the rays of each slab: [slab][view].
using SlabSums = std::vector<std::vector<ViewSums>>;

/// Returns the errors of `views` from sums over their rays, added in order of the slabs;
/// `noise_weight` holds 1 / variance of the noise of each view of the series. With
/// `fit_view_scale`, a view's scale and offset are least squares on that view
/// alone: they are nuisances of its exposure, which no other view tells.
ViewErrors view_errors(std::vector<int> views, const SlabSums& sums,
                       std::span<const double> noise_weight, bool fit_view_scale);

}  // namespace tomofield::measurement
