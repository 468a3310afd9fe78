// Predicts views, and scores the field on those that are held out.

#include <span>
#include <utility>
#include <vector>

#include "base/trace.h"
#include "fit/fit.h"

namespace tomofield::fit {
namespace {

// Scales predictions by the models of their views.
void apply_models(std::span<const measurement::ViewModel> models,
                  std::vector<measurement::PredictedView>& views) {
  for (std::size_t i = 0; i < views.size(); ++i)
    for (float& value : views[i].predicted)
      value = static_cast<float>(models[i].scale * static_cast<double>(value) + models[i].offset);
}

}  // namespace

measurement::ViewErrors Fit::held_out_error(bool fit_view_scale) const {
  if (filters_.transfers.empty())
    return objective_->held_out_error(binned_->noise_weights(), fit_view_scale);
  std::vector<measurement::ViewSums> sums;
  for (const int view : measurement_.held_out) {
    const auto predicted = predict(std::span(&view, 1), std::vector<measurement::ViewModel>(1));
    sums.push_back(measurement::sums_of(predicted.front(), {}));
  }
  return errors_of(std::move(sums), fit_view_scale);
}

Fit::HeldOut Fit::predict_held_out(bool fit_view_scale) const {
  const std::vector<int>& views = measurement_.held_out;
  HeldOut found{.errors = {},
                .views = predict(views, std::vector<measurement::ViewModel>(views.size()))};
  std::vector<measurement::ViewSums> sums;
  for (const measurement::PredictedView& view : found.views)
    sums.push_back(measurement::sums_of(view, {}));
  found.errors = errors_of(std::move(sums), fit_view_scale);
  apply_models(found.errors.models, found.views);
  return found;
}

// Returns the errors of the held-out views from the sums over all of their rays.
measurement::ViewErrors Fit::errors_of(std::vector<measurement::ViewSums> held_out,
                                       bool fit_view_scale) const {
  return measurement::view_errors(measurement_.held_out, {std::move(held_out)},
                                  binned_->noise_weights(), fit_view_scale || has_free_offsets());
}

std::vector<measurement::PredictedView> Fit::predict(
    std::span<const int> views, std::span<const measurement::ViewModel> models) const {
  if (filters_.transfers.empty()) return objective_->predict(views, models);
  auto predicted = project(views);
  measurement::filter_predictions(filters_.transfers, views, predicted, processes());
  apply_models(models, predicted);
  return predicted;
}

std::vector<measurement::PredictedView> Fit::project(std::span<const int> views) const {
  return objective_->predict(views, std::vector<measurement::ViewModel>(views.size()));
}

void Fit::score_held_out() {
  const base::TraceSpan span("score held-out views");
  const measurement::ViewErrors error = held_out_error();
  for (std::size_t i = 0; i < error.views.size(); ++i)
    progress_.views[static_cast<std::size_t>(error.views[i])] = error.models[i];
  progress_.held_out_error.push_back(error.total);
}

}  // namespace tomofield::fit
