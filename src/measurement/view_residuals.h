#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "distributed/communicator.h"

namespace tomofield::measurement {

/// How a view's measurement relates to the predicted line integrals p:
/// measured ≈ scale · p + offset, with noise of variance 1 / weight.
struct ViewModel {
  double scale = 1.0;
  double offset = 0.0;
  double weight = 1.0;
};

/// Sums over the rays of a view that count, p predicted and b measured: what
/// the loss is reported from and the closed-form nuisances are solved from.
struct ViewSums {
  double n = 0, p = 0, b = 0, pp = 0, pb = 0, bb = 0;
  ViewSums& operator+=(const ViewSums& other);
  /// Σ (scale p + offset − b)².
  double squared_residual(const ViewModel& model) const;
};
/// Completes sums of which every one is of one process, as Communicator::allreduce_sum.
void allreduce_sum(const distributed::Communicator& processes, std::span<ViewSums> sums);

/// Eq. 2 for one view of a slab: ½ · weight · Σ mask (scale p + offset − b)².
/// `rays` holds p [x, lane] and is overwritten by multiplicity · dL/dp;
/// multiplicity scales a subset of the views up to all of them. Masked rays
/// get 0. Returns the sums.
ViewSums data_term(const ViewModel& model, double multiplicity, const float* measured,
                   const std::uint16_t* mask, std::int64_t width, float* rays);

/// The same for a single ray that counts: adds it to the sums of its view and
/// returns multiplicity · dL/dp.
double ray_data_term(const ViewModel& model, double multiplicity, double measured, double predicted,
                     ViewSums& sums);

/// Per-view scale and offset in closed form: least squares with a shrinkage
/// prior worth `shrinkage` times the view's own rays,
///
///   min  w Σ (a p + o − b)² + shrinkage · w (Σ p² (a − 1)² + n o²).
///
/// Without it an extended slab's laterally constant part could stay in free
/// offsets; with it each fit leaves a share of the residual to the density,
/// which takes it over in the course of the epochs. Afterwards Σ log scale = 0.
struct NuisancePrior {
  double shrinkage = 0.1;
};
void fit_nuisances(const NuisancePrior& prior, const std::vector<ViewSums>& sums,
                   std::vector<ViewModel>& views);

}  // namespace tomofield::measurement
