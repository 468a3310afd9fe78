#include "measurement/surrogate_views.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <numbers>
#include <utility>

#include "base/threads/parallel.h"

namespace tomofield::measurement {
namespace {

// ‖H‖² may be so much larger than the largest |CTF|², since a filter repeats what lies near the
// border of its image (microscope::ViewFilter).
constexpr double kRepetition = 1.1;

using microscope::ViewFilter;

// Calls a function with each index that this process works on, on all threads.
template <typename Body>
void for_own(const char* what, std::size_t count, const distributed::Communicator& processes,
             const Body& body) {
  const std::int64_t every = processes.size(), first = processes.rank();
  const std::int64_t own = (static_cast<std::int64_t>(count) - first + every - 1) / every;
  base::parallel_for(what, std::max<std::int64_t>(own, 0),
                     [&](std::int64_t i) { body(static_cast<std::size_t>(first + i * every)); });
}

// Holds what one process finds of one view.
struct Surrogate {
  std::vector<float> image;  // d′
  ViewSums sums;
  double bound = 0.0;  // of max |H|² W
};

// Returns the residuals of a view by its filtered prediction; 0 where nothing was measured.
std::vector<float> residual_of(const PredictedView& filtered, const ViewModel& model) {
  const double limit = model.largest_residual;
  std::vector<float> residual(filtered.predicted.size());
  for (std::size_t i = 0; i < residual.size(); ++i) {
    const double missing = static_cast<double>(filtered.measured[i]) -
                           model.scale * static_cast<double>(filtered.predicted[i]) - model.offset;
    residual[i] =
        std::isnan(missing) ? 0.0f : static_cast<float>(std::clamp(missing, -limit, limit));
  }
  return residual;
}

// Replaces residuals by W times them, and returns the weights of the shells.
std::vector<double> weigh_frequencies(const NoiseColour& noise, const PredictedView& view,
                                      std::vector<float>& residual) {
  std::vector<double> weights = noise.weigh(residual);
  for (std::size_t i = 0; i < residual.size(); ++i)
    if (std::isnan(view.measured[i])) residual[i] = 0.0f;
  return weights;
}

// Returns a bound of max |H|² W. Without weights, W is 1. Between the middles of two shells, W is
// between theirs.
double bound_of(const ViewFilter* transfer, std::span<const double> weights) {
  constexpr double kHighest = std::numbers::sqrt2 / 2;  // cycles a pixel, in a corner
  const auto largest = [&](double from, double to, double weight) {
    return transfer ? weight * std::pow(transfer->largest_transfer(from, to), 2) : weight;
  };
  const double repetition = transfer ? kRepetition : 1.0;
  if (weights.empty()) return repetition * largest(0.0, kHighest, 1.0);
  double bound = 0.0, from = 0.0, weight = weights.front();
  for (std::size_t s = 0; s < weights.size(); ++s) {
    const double to = NoiseColour::frequency_of(static_cast<std::int64_t>(s));
    bound = std::max(bound, largest(from, to, std::max(weight, weights[s])));
    from = to;
    weight = weights[s];
  }
  return repetition * std::max(bound, largest(from, kHighest, weight));
}

Surrogate surrogate_of(const PredictedView& view, const ViewFilter* transfer,
                       const std::optional<NoiseColour>& noise, ViewModel model) {
  PredictedView filtered = view;
  if (transfer) filtered.predicted = transfer->apply(view.predicted);
  if (transfer && !transfer->passes_mean())
    model.offset = mean_offset(sums_of(filtered, model), model);
  std::vector<float> residual = residual_of(filtered, model);
  std::vector<double> weights;
  if (noise) weights = weigh_frequencies(*noise, view, residual);
  Surrogate surrogate{transfer ? transfer->apply_transpose(residual) : std::move(residual),
                      sums_of(filtered, model), bound_of(transfer, weights)};
  const auto step = static_cast<float>(1.0 / (model.scale * surrogate.bound));
  for (std::size_t i = 0; i < surrogate.image.size(); ++i)
    surrogate.image[i] = view.predicted[i] + step * surrogate.image[i];
  return surrogate;
}

}  // namespace

std::vector<ViewFilter> view_filters(const Measurement& measurement) {
  const SlabViews::Shape& shape = measurement.rays->shape();
  std::vector<ViewFilter> filters;
  for (const microscope::ViewTransfer& transfer : measurement.transfers)
    filters.emplace_back(shape.width, shape.num_rows, transfer);
  return filters;
}

std::int64_t largest_reach_px(const Measurement& measurement) {
  const SlabViews::Shape shape = measurement.rays_shape();
  std::int64_t reach = 0;
  for (const microscope::ViewTransfer& transfer : measurement.transfers)
    reach = std::max(reach, microscope::reach_px(transfer, shape.width, shape.num_rows));
  return reach;
}

void filter_predictions(std::span<const ViewFilter> filters, std::span<const int> views,
                        std::span<PredictedView> predicted,
                        const distributed::Communicator& processes) {
  std::vector<std::vector<float>> filtered(views.size());
  for_own("filter views", views.size(), processes, [&](std::size_t i) {
    filtered[i] = filters[static_cast<std::size_t>(views[i])].apply(predicted[i].predicted);
  });
  for (std::size_t i = 0; i < views.size(); ++i) {
    filtered[i].resize(predicted[i].predicted.size());
    processes.allreduce_sum(std::span(filtered[i]));
    predicted[i].predicted = std::move(filtered[i]);
  }
}

ViewSums sums_of(const PredictedView& view, const ViewModel& model) {
  double n = 0, sp = 0, sb = 0, spp = 0, spb = 0, sbb = 0, squares = 0;
  for (std::size_t i = 0; i < view.measured.size(); ++i) {
    const double b = static_cast<double>(view.measured[i]);
    if (std::isnan(b)) continue;
    const double p = static_cast<double>(view.predicted[i]);
    const double residual = std::clamp(model.scale * p + model.offset - b, -model.largest_residual,
                                       model.largest_residual);
    n += 1.0;
    sp += p;
    sb += b;
    spp += p * p;
    spb += p * b;
    sbb += b * b;
    squares += residual * residual;
  }
  return {n, sp, sb, spp, spb, sbb, squares};
}

SurrogateViews::SurrogateViews(const SlabViews& measured, std::vector<int> views,
                               std::span<const ViewModel> models)
    : views_(std::move(views)),
      places_(models.size(), -1),
      rays_(measured.blank(views_.size())),
      measured_models_(models.begin(), models.end()),
      models_(measured_models_),
      sums_(models.size()) {
  for (std::size_t i = 0; i < views_.size(); ++i)
    places_[static_cast<std::size_t>(views_[i])] = static_cast<int>(i);
}

void SurrogateViews::set(const DataFilters& filters, std::span<const int> views,
                         std::vector<PredictedView> predicted,
                         const distributed::Communicator& processes) {
  std::vector<ViewSums> sums(views.size());
  std::vector<double> bounds(views.size());
  for_own("make surrogate views", views.size(), processes, [&](std::size_t i) {
    const auto view = static_cast<std::size_t>(views[i]);
    Surrogate made =
        surrogate_of(predicted[i], filters.transfers.empty() ? nullptr : &filters.transfers[view],
                     filters.noise, measured_models_[view]);
    predicted[i].measured = std::move(made.image);
    predicted[i].predicted.clear();
    sums[i] = made.sums;
    bounds[i] = made.bound;
  });
  allreduce_sum(processes, sums);
  processes.allreduce_sum(std::span(bounds));
  for (std::size_t i = 0; i < views.size(); ++i) {
    // A process has the surrogates of some views, and gives up the others' measured pixels.
    std::vector<float>& image = predicted[i].measured;
    if (!predicted[i].predicted.empty()) std::ranges::fill(image, 0.0f);
    processes.allreduce_sum(std::span(image));
    rays_->set_view(place(views[i]), image);
    const auto view = static_cast<std::size_t>(views[i]);
    sums_[view] = sums[i];
    const ViewModel& model = measured_models_[view];
    models_[view] = {1.0, 0.0, model.weight * model.scale * model.scale * bounds[i]};
  }
}

}  // namespace tomofield::measurement
