#include "reconstruct/defocus_check.h"

#include <algorithm>
#include <cmath>
#include <span>
#include <vector>

#include "base/parallel.h"
#include "base/percentile.h"
#include "base/trace.h"
#include "microscope/view_filter.h"
#include "reconstruct/view_agreement.h"

namespace tomofield::reconstruction {
namespace {

constexpr int kFewestViews = 5;

// Derivatives are differences over this part of the defocus to both sides.
constexpr double kStep = 0.01;

// Holds what a view tells of its defocus.
struct OfView {
  double error = 0.0;  // part of the defocus
  double rings = 0.0;
  bool tells = false;
};

microscope::ViewTransfer with_defocus(microscope::ViewTransfer transfer, double factor) {
  transfer.defocus.u_A *= factor;
  transfer.defocus.v_A *= factor;
  return transfer;
}

// Fits the change of the defocus to what a view's prediction lacks, by least squares. `projected`
// is the view with its projection.
OfView check_view(const measurement::PredictedView& projected,
                  const microscope::ViewTransfer& transfer, const measurement::ViewModel& model) {
  const auto filtered = [&](double factor) {
    return microscope::ViewFilter(projected.width, projected.height, with_defocus(transfer, factor))
        .apply(projected.predicted);
  };
  const std::vector<float> given = filtered(1.0), more = filtered(1.0 + kStep),
                           less = filtered(1.0 - kStep);
  double changes = 0.0, both = 0.0, residuals = 0.0;
  for (std::size_t i = 0; i < given.size(); ++i) {
    const double measured = static_cast<double>(projected.measured[i]);
    if (std::isnan(measured)) continue;
    const double residual =
        std::clamp(measured - model.scale * static_cast<double>(given[i]) - model.offset,
                   -model.largest_residual, model.largest_residual);
    const double change =
        model.scale * (static_cast<double>(more[i]) - static_cast<double>(less[i])) / (2 * kStep);
    changes += change * change;
    both += change * residual;
    residuals += residual * residual;
  }
  if (!(changes > 0.0) || !(residuals > 0.0)) return {};
  return {both / changes, both * both / (changes * residuals), true};
}

}  // namespace

std::optional<DefocusCheck> check_defocus(const fit::Fit& fit,
                                          const measurement::Measurement& series) {
  const bool has_defocus = std::ranges::any_of(
      series.transfers, [](const auto& transfer) { return transfer.defocus.u_A != 0.0; });
  if (!has_defocus) return std::nullopt;
  const base::TraceSpan span("check defocus");
  const std::vector<int> views = views_to_compare(series.geometry.tilt_deg);
  std::vector<OfView> found(views.size());
  const std::size_t at_once = views_at_once(series);
  for (std::size_t first = 0; first < views.size(); first += at_once) {
    const auto some = std::span(views).subspan(first, std::min(at_once, views.size() - first));
    const std::vector<measurement::PredictedView> projected = fit.project(some);
    base::parallel_for("check defocus", std::ssize(some), [&](std::int64_t i) {
      const auto view = static_cast<std::size_t>(some[static_cast<std::size_t>(i)]);
      found[first + static_cast<std::size_t>(i)] =
          check_view(projected[static_cast<std::size_t>(i)], series.transfers[view],
                     fit.progress().views[view]);
    });
  }
  std::vector<float> errors, rings;
  for (const OfView& view : found) {
    if (!view.tells) continue;
    errors.push_back(static_cast<float>(view.error));
    rings.push_back(static_cast<float>(view.rings));
  }
  if (std::ssize(errors) < kFewestViews) return std::nullopt;
  DefocusCheck check;
  check.error = base::percentile(errors, 50);
  check.rings = base::percentile(rings, 50);
  for (float& error : errors) error = std::abs(error - static_cast<float>(check.error));
  // The standard deviation of normal numbers is 1.48 times their median deviation, and their median
  // scatters by 1.25 times as much as their mean.
  check.standard_error =
      1.25 * 1.48 * base::percentile(errors, 50) / std::sqrt(static_cast<double>(errors.size()));
  return check;
}

}  // namespace tomofield::reconstruction
