#include "verdict/defocus_check.h"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <span>
#include <vector>

#include "base/statistics.h"
#include "base/threads/parallel.h"
#include "base/trace.h"
#include "microscope/view_filter.h"
#include "verdict/view_agreement.h"

namespace tomofield::verdict {
namespace {

constexpr int kFewestViews = 5;

// Derivatives are differences over this part of the defocus, or of its slope, to both sides.
constexpr double kStep = 0.01, kSlopeStep = 0.5;

// A field is weaker than the specimen at some frequencies, by its priors and its vertices. A
// residual therefore holds a part of the prediction, which is a smooth function of the frequency: a
// polynomial in k² with kGains terms stands for it.
constexpr int kGains = 4;
constexpr int kDefocus = kGains, kSlope = kGains + 1, kColumns = kGains + 2;

// Larger views tell no more than their middle, whose rings are finer than the steps of its
// transform.
constexpr std::int64_t kSpectrumSide = 512;

using Columns = std::vector<std::vector<float>>;

// Holds a number that a view tells of its defocus, and how well it tells it: the sum of squares
// that a change by 1 explains, of which nothing else explains a part.
struct Estimate {
  double value = 0.0, weight = 0.0;
};
struct OfView {
  Estimate defocus, slope;
  double rings = 0.0;
  evaluate::Image middle;  // of the measured view
};

microscope::ViewTransfer with_factors(microscope::ViewTransfer transfer, double defocus,
                                      double slope) {
  transfer.defocus.u_A *= defocus;
  transfer.defocus.v_A *= defocus;
  transfer.slope.at_centre_A *= slope;
  transfer.slope.x_A *= slope;
  transfer.slope.y_A *= slope;
  return transfer;
}

// Returns minus the second differences of an image [y, x], which has mirrored borders: its spectrum
// times k², nearly.
std::vector<float> sharpened(const std::vector<float>& image, std::int64_t width,
                             std::int64_t height) {
  std::vector<float> result(image.size());
  const auto at = [&](std::int64_t x, std::int64_t y) {
    return image[static_cast<std::size_t>(std::clamp<std::int64_t>(y, 0, height - 1) * width +
                                          std::clamp<std::int64_t>(x, 0, width - 1))];
  };
  for (std::int64_t y = 0; y < height; ++y)
    for (std::int64_t x = 0; x < width; ++x)
      result[static_cast<std::size_t>(y * width + x)] =
          4 * at(x, y) - at(x - 1, y) - at(x + 1, y) - at(x, y - 1) - at(x, y + 1);
  return result;
}

// Returns what a residual may hold: the filtered prediction in kGains bands of frequencies, and its
// changes with the defocus and with the slope.
Columns columns_of(const measurement::PredictedView& view,
                   const microscope::ViewTransfer& transfer) {
  const auto filtered = [&](double defocus, double slope) {
    return microscope::ViewFilter(view.width, view.height, with_factors(transfer, defocus, slope))
        .apply(view.predicted);
  };
  const auto change = [](std::vector<float> more, const std::vector<float>& less, double step) {
    for (std::size_t i = 0; i < more.size(); ++i)
      more[i] = (more[i] - less[i]) / static_cast<float>(2 * step);
    return more;
  };
  Columns columns{filtered(1, 1)};
  while (columns.size() < kGains)
    columns.push_back(sharpened(columns.back(), view.width, view.height));
  columns.push_back(change(filtered(1 + kStep, 1), filtered(1 - kStep, 1), kStep));
  columns.push_back(change(filtered(1, 1 + kSlopeStep), filtered(1, 1 - kSlopeStep), kSlopeStep));
  return columns;
}

// Returns the coefficient of a column in the solution, and its weight.
Estimate estimate_of(const Eigen::MatrixXd& inverse, const Eigen::VectorXd& solution, int column) {
  const double variance = inverse(column, column);
  return variance > 0 ? Estimate{solution(column), 1.0 / variance} : Estimate{};
}

// Fits the changes of the defocus and of its slope to what a view's prediction lacks, by least
// squares. `projected` is the view with its projection.
OfView check_view(const measurement::PredictedView& projected,
                  const microscope::ViewTransfer& transfer, const measurement::ViewModel& model) {
  const Columns columns = columns_of(projected, transfer);
  // A view without a tilt has no slope.
  const int num_columns =
      transfer.slope.x_A == 0.0 && transfer.slope.y_A == 0.0 ? kSlope : kColumns;
  Eigen::MatrixXd products = Eigen::MatrixXd::Zero(num_columns, num_columns);
  Eigen::VectorXd right = Eigen::VectorXd::Zero(num_columns), row(num_columns);
  double squares = 0.0;
  for (std::size_t i = 0; i < projected.measured.size(); ++i) {
    const double measured = static_cast<double>(projected.measured[i]);
    if (std::isnan(measured)) continue;
    for (int c = 0; c < num_columns; ++c)
      row(c) = model.scale * static_cast<double>(columns[static_cast<std::size_t>(c)][i]);
    const double residual = std::clamp(measured - row(0) - model.offset, -model.largest_residual,
                                       model.largest_residual);
    products.selfadjointView<Eigen::Lower>().rankUpdate(row);
    right += residual * row;
    squares += residual * residual;
  }
  const Eigen::LDLT<Eigen::MatrixXd> solver(products.selfadjointView<Eigen::Lower>());
  const Eigen::MatrixXd inverse = solver.solve(Eigen::MatrixXd::Identity(num_columns, num_columns));
  const Eigen::VectorXd solution = inverse * right;
  if (!(squares > 0.0) || !solution.allFinite()) return {};
  OfView found;
  found.defocus = estimate_of(inverse, solution, kDefocus);
  if (num_columns > kSlope) found.slope = estimate_of(inverse, solution, kSlope);
  found.rings = found.defocus.value * found.defocus.value * found.defocus.weight / squares;
  return found;
}

// Returns at most kSpectrumSide² pixels from the middle of a measured view.
evaluate::Image middle_of(const measurement::PredictedView& view) {
  evaluate::Image middle{
      std::min(view.width, kSpectrumSide), std::min(view.height, kSpectrumSide), {}};
  const std::int64_t x0 = (view.width - middle.width) / 2, y0 = (view.height - middle.height) / 2;
  for (std::int64_t y = y0; y < y0 + middle.height; ++y) {
    const auto row = view.measured.begin() + y * view.width + x0;
    middle.values.insert(middle.values.end(), row, row + middle.width);
  }
  return middle;
}

// Returns what each of some views tells.
std::vector<OfView> check_views(const fit::Fit& fit, const measurement::Measurement& series,
                                const std::vector<int>& views) {
  std::vector<OfView> found(views.size());
  const std::size_t at_once = views_at_once(series);
  for (std::size_t first = 0; first < views.size(); first += at_once) {
    const auto some = std::span(views).subspan(first, std::min(at_once, views.size() - first));
    const std::vector<measurement::PredictedView> projected = fit.project(some);
    base::parallel_for("check defocus", std::ssize(some), [&](std::int64_t i) {
      const auto view = static_cast<std::size_t>(some[static_cast<std::size_t>(i)]);
      OfView& of_view = found[first + static_cast<std::size_t>(i)];
      of_view = check_view(projected[static_cast<std::size_t>(i)], series.transfers[view],
                           fit.progress().views[view]);
      of_view.middle = middle_of(projected[static_cast<std::size_t>(i)]);
    });
  }
  return found;
}

std::optional<RingCheck> check_spectra(const std::vector<OfView>& found,
                                       const measurement::Measurement& series,
                                       const std::vector<int>& views) {
  std::vector<evaluate::Image> images;
  std::vector<microscope::ViewTransfer> transfers;
  for (std::size_t i = 0; i < found.size(); ++i) {
    images.push_back(found[i].middle);
    transfers.push_back(series.transfers[static_cast<std::size_t>(views[i])]);
  }
  return check_rings(images, transfers);
}

// Returns the weighted mean of what the views say of the slope, and its standard error by their
// scatter. Nothing if few views say something.
std::optional<DefocusCheck::Slope> mean_slope(const std::vector<OfView>& found) {
  double weights = 0.0, sum = 0.0, scatter = 0.0;
  int count = 0;
  for (const OfView& view : found) {
    weights += view.slope.weight;
    sum += view.slope.weight * view.slope.value;
    count += view.slope.weight > 0.0;
  }
  if (count < kFewestViews) return std::nullopt;
  const double mean = sum / weights;
  for (const OfView& view : found)
    scatter += std::pow(view.slope.weight * (view.slope.value - mean), 2);
  return DefocusCheck::Slope{mean, std::sqrt(scatter) / weights};
}

}  // namespace

std::optional<DefocusCheck> check_defocus(const fit::Fit& fit,
                                          const measurement::Measurement& series) {
  const bool has_defocus = std::ranges::any_of(
      series.transfers, [](const auto& transfer) { return transfer.defocus.u_A != 0.0; });
  if (!has_defocus) return std::nullopt;
  const base::TraceSpan span("check defocus");
  const std::vector<int> views = views_to_compare(series.geometry.tilt_deg);
  const std::vector<OfView> found = check_views(fit, series, views);
  std::vector<float> errors, rings;
  for (const OfView& view : found) {
    if (view.defocus.weight == 0.0) continue;
    errors.push_back(static_cast<float>(view.defocus.value));
    rings.push_back(static_cast<float>(view.rings));
  }
  if (std::ssize(errors) < kFewestViews) return std::nullopt;
  DefocusCheck check;
  check.error = base::median(errors);
  check.rings = base::median(rings);
  for (float& error : errors) error = std::abs(error - static_cast<float>(check.error));
  // The median of normal numbers scatters by 1.25 times as much as their mean.
  check.standard_error = 1.25 * base::kSigmaOfMedianDeviation * base::median(errors) /
                         std::sqrt(static_cast<double>(errors.size()));
  check.slope = mean_slope(found);
  check.spectra = check_spectra(found, series, views);
  return check;
}

}  // namespace tomofield::verdict
