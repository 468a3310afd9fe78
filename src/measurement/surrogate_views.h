#pragma once

#include <memory>
#include <optional>
#include <span>
#include <vector>

#include "distributed/communicator.h"
#include "measurement/held_out.h"
#include "measurement/measurement.h"
#include "measurement/noise_colour.h"
#include "measurement/view_residuals.h"
#include "microscope/view_filter.h"

namespace tomofield::measurement {

/// Returns the filter H of each view of a measurement that has transfers, on the rows of its rays.
std::vector<microscope::ViewFilter> view_filters(const Measurement& measurement);

/// Returns how far the transfers of a measurement move what is in a view at most, in pixels.
/// Returns 0 if it has none.
std::int64_t largest_reach_px(const Measurement& measurement);

/// Replaces the predictions of some views by what the microscope makes of them: p by H p. `filters`
/// are those of all views. Every process calls it and gets the same.
void filter_predictions(std::span<const microscope::ViewFilter> filters, std::span<const int> views,
                        std::span<PredictedView> predicted,
                        const distributed::Communicator& processes);

/// Returns the sums over the pixels of a view that count, of what is predicted and measured.
/// `largest_residual` limits the squares of residuals by the model (ViewSums::limited_squares).
ViewSums sums_of(const PredictedView& view, const ViewModel& model);

/// The filters between the projections of the views and their data term.
struct DataFilters {
  std::vector<microscope::ViewFilter> transfers;  ///< [view]: H; empty: views are projections
  std::optional<NoiseColour> noise;               ///< W; none: the noise is white

  bool empty() const { return transfers.empty() && !noise; }
};

/// Views that take the place of the measured ones in the steps of a fit, so that the transfer H of
/// the microscope, which mixes rows, does not concern the slabs.
///
/// A view's data term ½ w |W^½ (a H p + o − d)|² of its projection p is nowhere above the quadratic
/// ½ w L |p − d′|² + constant that touches it at the present projection p₀, where
///
///   d′ = p₀ + (a / L) Hᵀ W (d − a H p₀ − o)   and   L = a² max |H|² W.
///
/// (Surrogates of this kind: De Pierro 1995; Daubechies, Defrise and De Mol 2004.) Its gradient at
/// p₀ is that of the data term itself. A residual of a masked pixel counts as 0, and one that is
/// larger than the model's limit counts as that limit. W is that of the present residual. The
/// offset o is the model's, or mean_offset() if H does not pass the mean of the projection.
class SurrogateViews {
 public:
  /// Makes room for the surrogates of `views`. `models` are those of all views. The surrogates have
  /// the slabs of `measured`.
  SurrogateViews(const SlabViews& measured, std::vector<int> views,
                 std::span<const ViewModel> models);

  /// Makes the surrogates of some of the views from their predictions without a model (scale 1,
  /// offset 0), which it gives up. `filters` are those of all views. Every process calls it.
  void set(const DataFilters& filters, std::span<const int> views,
           std::vector<PredictedView> predicted, const distributed::Communicator& processes);

  const std::vector<int>& views() const { return views_; }
  /// Returns the place of a view in rays(), or −1 if it has no surrogate.
  int place(int view) const { return places_[static_cast<std::size_t>(view)]; }
  /// Returns d′ of each view at its place; all of its rays count.
  const SlabViews& rays() const { return *rays_; }
  /// Returns the models to fit the surrogates with: all of `models`, but scale 1, offset 0 and
  /// weight w L for each of `views`.
  const std::vector<ViewModel>& models() const { return models_; }
  /// Returns the sums over the measured pixels of a view, of H p₀ and d.
  const ViewSums& sums(int view) const { return sums_[static_cast<std::size_t>(view)]; }

 private:
  std::vector<int> views_, places_;  // places of all views
  std::unique_ptr<SlabViews> rays_;
  std::vector<ViewModel> measured_models_, models_;  // of all views
  std::vector<ViewSums> sums_;                       // of all views
};

}  // namespace tomofield::measurement
