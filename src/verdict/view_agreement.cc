#include "verdict/view_agreement.h"

#include <algorithm>
#include <cmath>
#include <span>
#include <utility>

#include "base/statistics.h"
#include "base/threads/parallel.h"
#include "base/trace.h"
#include "evaluate/image_pair.h"
#include "geometry/tilt_geometry.h"
#include "verdict/likeness_order.h"

namespace tomofield::verdict {
namespace {

using evaluate::Image;

constexpr int kViews = 16;
// Sides of the images for displacements, and of those that tell which views are alike. The latter
// are so small that detail moves by a pixel or two between views that are some degrees apart. The
// direction of the tilt axis is found in images of a side between.
constexpr std::int64_t kSide = 256, kAxisSide = 128, kSmallSide = 64;
// Distance in pixels at which residuals are compared, beyond the reach of an interpolation.
constexpr std::int64_t kFar = 4;

// Returns the side of the smallest blocks whose means make an image no larger than `side`.
std::int64_t block_for(const Image& image, std::int64_t side) {
  return (std::max(image.width, image.height) + side - 1) / side;
}

// Returns the length of a ray in the volume, in pixels. Without a margin the volume ends at the
// faces of the region.
double ray_length(const measurement::Measurement& series, int view, double u, bool has_margin) {
  const geometry::TiltGeometry& g = series.geometry;
  const double length = g.thickness / g.cos_tilt(view);
  if (has_margin) return length;
  const auto [low, high] = std::minmax({g.ray_x(view, u, 0.0), g.ray_x(view, u, g.thickness)});
  const double begin = std::max(low, static_cast<double>(series.roi.x0));
  const double end = std::min(high, static_cast<double>(series.roi.x1));
  if (high - low < 1e-9) return begin <= end ? length : 0.0;
  return length * std::max(end - begin, 0.0) / (high - low);
}

// Fits a line through pairs of lengths and brightnesses.
class LineFit {
 public:
  void add(double length, double brightness) {
    shortest_ = std::min(shortest_, length);
    longest_ = std::max(longest_, length);
    n_ += 1;
    x_ += length;
    y_ += brightness;
    xx_ += length * length;
    xy_ += length * brightness;
    yy_ += brightness * brightness;
  }
  PathEffect effect(double contrast) const {
    const double vx = n_ * xx_ - x_ * x_, vy = n_ * yy_ - y_ * y_, xy = n_ * xy_ - x_ * y_;
    if (!(vx > 1e-9 * n_ * xx_) || !(vy > 0)) return {};
    return {xy / std::sqrt(vx * vy), xy / vx * (longest_ - shortest_) / contrast};
  }

 private:
  double shortest_ = 1e300, longest_ = 0;
  double n_ = 0, x_ = 0, y_ = 0, xx_ = 0, xy_ = 0, yy_ = 0;
};

// Holds what is known of a view after it was compared with its prediction.
struct ComparedView {
  std::array<double, 2> displacement_px{};
  double correlation = 0.0;
  std::array<double, 2> residual_correlation{}, far_correlation{};
  std::vector<double> column_means;
  Image of_axis;
  Image small;  // without the means of its columns
};

ComparedView compare(measurement::PredictedView&& both) {
  const Image measured{both.width, both.height, std::move(both.measured)};
  const Image predicted{both.width, both.height, std::move(both.predicted)};
  const std::int64_t block = block_for(measured, kSide);
  const Image seen = reduced(measured, block), told = reduced(predicted, block);
  auto displacement = evaluate::displacement(told, seen);
  for (double& d : displacement) d *= static_cast<double>(block);
  const Image small = reduced(seen, block_for(seen, kSmallSide));
  return {displacement,
          evaluate::correlation(told, seen),
          evaluate::difference_correlation(measured, predicted, 1),
          evaluate::difference_correlation(measured, predicted, kFar),
          evaluate::column_means(measured),
          reduced(seen, block_for(seen, kAxisSide)),
          evaluate::without_column_means(small)};
}

std::vector<ComparedView> compare(const fit::Fit& fit, std::span<const int> views) {
  std::vector<measurement::ViewModel> models;
  for (const int view : views)
    models.push_back(fit.progress().views[static_cast<std::size_t>(view)]);
  std::vector<measurement::PredictedView> predicted = fit.predict(views, models);
  std::vector<ComparedView> compared(views.size());
  base::parallel_for("compare views", std::ssize(views), [&](std::int64_t i) {
    const auto at = static_cast<std::size_t>(i);
    compared[at] = compare(std::move(predicted[at]));
  });
  return compared;
}

std::array<double, 2> medians(const std::vector<std::array<double, 2>>& pairs) {
  std::array<double, 2> found{};
  for (const std::size_t axis : {0, 1}) {
    std::vector<float> values;
    for (const auto& pair : pairs) values.push_back(static_cast<float>(pair[axis]));
    found[axis] = base::median(values);
  }
  return found;
}

double usual(std::vector<float> values) {
  return values.empty() ? 0.0 : base::percentile(std::move(values), 90);
}

}  // namespace

std::vector<int> views_to_compare(const std::vector<double>& tilt_deg) {
  const std::vector<std::size_t> all = geometry::order_of_tilts(tilt_deg);
  const int last = static_cast<int>(all.size()) - 1, count = std::min(kViews, last + 1);
  // Every second one lies a view farther, so that what every second view has in common is no rule.
  const bool may_move = count > 1 && last / (count - 1) > 1;
  std::vector<int> chosen;
  for (int i = 0; i < count; ++i) {
    int at = count == 1 ? 0 : i * last / (count - 1);
    if (may_move && i % 2 == 1 && at < last) ++at;
    chosen.push_back(static_cast<int>(all[static_cast<std::size_t>(at)]));
  }
  return chosen;
}

std::size_t views_at_once(const measurement::Measurement& series) {
  constexpr std::int64_t kBytes = std::int64_t{1} << 26;
  const std::int64_t of_view =
      series.geometry.width * series.roi.height() * std::int64_t{2 * sizeof(float)};
  return static_cast<std::size_t>(std::clamp<std::int64_t>(kBytes / of_view, 1, kViews));
}

double ViewAgreement::usual_displacement_px() const {
  std::vector<float> lengths;
  for (const auto& [x, y] : displacement_px)
    lengths.push_back(static_cast<float>(std::hypot(x, y)));
  return usual(std::move(lengths));
}

double ViewAgreement::usual_displacement_y_px() const {
  std::vector<float> lengths;
  for (const auto& both : displacement_px) lengths.push_back(static_cast<float>(std::abs(both[1])));
  return usual(std::move(lengths));
}

ViewAgreement compare_views(const fit::Fit& fit, const measurement::Measurement& series,
                            bool has_margin) {
  const base::TraceSpan span("compare views");
  ViewAgreement found;
  found.views = views_to_compare(series.geometry.tilt_deg);
  LineFit brightness;
  std::vector<Image> small, of_axis;
  std::vector<double> tilt_deg;
  std::vector<std::array<double, 2>> near, far;
  const std::span<const int> views(found.views);
  const std::size_t at_once = views_at_once(series);
  for (std::size_t first = 0; first < views.size(); first += at_once) {
    const std::size_t count = std::min(at_once, views.size() - first);
    std::vector<ComparedView> compared = compare(fit, views.subspan(first, count));
    for (std::size_t i = 0; i < count; ++i) {
      ComparedView& view = compared[i];
      found.displacement_px.push_back(view.displacement_px);
      found.correlation.push_back(view.correlation);
      near.push_back(view.residual_correlation);
      far.push_back(view.far_correlation);
      for (std::size_t x = 0; x < view.column_means.size(); ++x) {
        if (!std::isfinite(view.column_means[x])) continue;
        const double length =
            ray_length(series, views[first + i], static_cast<double>(x) + 0.5, has_margin);
        brightness.add(length, view.column_means[x]);
      }
      small.push_back(std::move(view.small));
      of_axis.push_back(std::move(view.of_axis));
      tilt_deg.push_back(series.geometry.tilt_deg[static_cast<std::size_t>(views[first + i])]);
    }
  }
  found.residual_correlation = medians(near);
  found.far_correlation = medians(far);
  found.axis = check_axis(of_axis, tilt_deg);
  found.tilt_order = order_by_likeness(small);
  found.path = brightness.effect(series.contrast());
  found.side_px = static_cast<double>(std::max(series.geometry.width, series.roi.height()));
  return found;
}

}  // namespace tomofield::verdict
