#pragma once

#include <functional>
#include <span>
#include <vector>

#include "measurement/held_out.h"
#include "objective/term.h"

namespace tomofield::objective {

/// The loss (eq. 9) of a field on one tree at one resolution: a list of terms that one engine
/// evaluates. An engine on a device would be a second class of this kind.
class Objective {
 public:
  virtual ~Objective() = default;

  /// Is called once for every leaf of this process when its gradient is complete, on any thread. It
  /// may change the parameters of that leaf and its gradient.
  using LeafDone = std::function<void(int leaf)>;
  /// Adds the gradient by all parameters of this process's leaves to `gradient`, and the sums of
  /// the step's residuals to `view_sums` (one for every view). Returns the derivative by the bias.
  /// Every process calls it; sums have the same bits for any number of threads and processes.
  virtual double add_gradient(const Step& step, float* gradient,
                              std::span<measurement::ViewSums> view_sums,
                              const LeafDone& leaf_done) const = 0;

  /// Scores the field on views that it was not fitted to; `noise_weight` is 1 / variance of the
  /// noise of every view.
  virtual measurement::ViewErrors held_out_error(std::span<const double> noise_weight,
                                                 bool fit_view_scale) const = 0;
  /// Predicts some views, each with its model, beside what was measured.
  virtual std::vector<measurement::PredictedView> predict(
      std::span<const int> views, std::span<const measurement::ViewModel> models) const = 0;
};

}  // namespace tomofield::objective
