#include "measurement/measurement.h"

#include <algorithm>

#include "base/check.h"
#include "base/trace.h"

namespace tomofield::measurement {
namespace {

template <typename T>
std::vector<T> chosen(const std::vector<T>& values, std::span<const int> indices) {
  std::vector<T> result;
  if (values.empty()) return result;  // not known of this measurement
  for (const int i : indices) result.push_back(values[static_cast<std::size_t>(i)]);
  return result;
}

}  // namespace

std::vector<double> Measurement::noise_weights() const {
  std::vector<double> weights;
  for (const double sigma : noise_sigma) weights.push_back(1.0 / (sigma * sigma));
  return weights;
}

std::vector<int> Measurement::fitted_views() const {
  std::vector<int> views;
  for (int view = 0; view < geometry.num_views(); ++view)
    if (!std::ranges::binary_search(held_out, view) && !std::ranges::binary_search(left_out, view))
      views.push_back(view);
  return views;
}

SlabViews::Shape Measurement::rays_shape() const {
  const auto num_views = static_cast<std::size_t>(geometry.num_views());
  if (ray_geometry) {
    return {num_views, ray_geometry->raw_width, ray_geometry->raw_height, 0,
            ray_geometry->raw_height};
  }
  return {num_views, geometry.width, geometry.height, roi.y0, roi.height()};
}

// A mean over bin² pixels has a bin-th of their noise, and rays are a bin-th as long.
Measurement binned(const Measurement& fine, int bin) {
  TOMOFIELD_CHECK(bin % fine.rays_bin == 0, "the rays have wider pixels");
  Measurement coarse = fine;
  if (bin == 1) return coarse;
  const base::TraceSpan span("bin views");
  if (bin != fine.rays_bin) coarse.rays = fine.rays->binned(bin / fine.rays_bin);
  coarse.rays_bin = 1;
  coarse.geometry.width = coarse.rays->shape().width;
  coarse.geometry.height = coarse.rays->shape().height;
  coarse.geometry.thickness /= bin;
  coarse.geometry.axis_x /= bin;
  coarse.geometry.axis_z /= bin;
  for (double& sigma : coarse.noise_sigma) sigma /= bin * bin;
  for (microscope::ViewTransfer& transfer : coarse.transfers) transfer = transfer.binned(bin);
  for (auto& discs : coarse.undecided_beads)
    for (auto& [x, y, radius] : discs) x /= bin, y /= bin, radius /= bin;
  return coarse;
}

Measurement some_rows(const Measurement& whole, base::Range rows, std::span<const int> views,
                      const distributed::Communicator& processes) {
  TOMOFIELD_CHECK(!whole.ray_geometry, "rays of views as recorded do not stay in their row");
  const base::TraceSpan span("copy rows");
  Measurement part = whole;
  part.rays = whole.rays->rows(rows, views, processes);
  part.roi.y0 += rows.begin;
  part.roi.y1 = part.roi.y0 + rows.size();
  part.geometry.tilt_deg = chosen(whole.geometry.tilt_deg, views);
  part.noise_sigma = chosen(whole.noise_sigma, views);
  part.transfers = chosen(whole.transfers, views);
  part.masks.beads_found = chosen(whole.masks.beads_found, views);
  part.masks.beads_masked = chosen(whole.masks.beads_masked, views);
  part.masked_part = chosen(whole.masked_part, views);
  part.undecided_beads = chosen(whole.undecided_beads, views);
  for (auto& discs : part.undecided_beads)
    for (tilt_series::MaskDisc& disc : discs) disc.y_px -= rows.begin;
  part.held_out.clear();
  for (int v = 0; v < static_cast<int>(views.size()); ++v) {
    if (std::ranges::binary_search(whole.held_out, views[static_cast<std::size_t>(v)]))
      part.held_out.push_back(v);
  }
  return part;
}

Measurement middle_rows(const Measurement& whole, std::int64_t max_rows, std::span<const int> views,
                        const distributed::Communicator& processes) {
  const std::int64_t all_rows = whole.rays->shape().num_rows;
  const std::int64_t rows = std::min(max_rows, all_rows);
  const auto first = static_cast<int>((all_rows - rows) / 2);
  return some_rows(whole, {first, first + static_cast<int>(rows)}, views, processes);
}

}  // namespace tomofield::measurement
