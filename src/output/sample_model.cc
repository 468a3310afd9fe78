#include "output/sample_model.h"

#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <limits>
#include <string>

#include "base/log.h"
#include "base/progress.h"
#include "base/system/memory.h"
#include "compact/sample_coded.h"
#include "output/box_bounds.h"

namespace tomofield::output {
namespace {

// Returns a small box of the same voxels, where the box meets the model or else in its middle.
field::OrientedBox small_part(const Model& model, const field::OrientedBox& box) {
  constexpr double kMostPoints = 1 << 20;
  field::OrientedBox part = box;
  const BoxBounds bounds(box), model_bounds = field_bounds(model);
  for (std::size_t a = 0; a < 3; ++a) {
    const double low = std::max(bounds.low[a], model_bounds.low[a]);
    const double high = std::min(bounds.high[a], model_bounds.high[a]);
    if (low < high) part.centre_px[a] = (low + high) / 2;
  }
  while (field::num_points(part) > kMostPoints && *std::ranges::max_element(part.size) > 1) {
    std::int64_t& side = *std::ranges::max_element(part.size);
    side = (side + 1) / 2;
  }
  return part;
}

// Returns about how much of a box lies in the model: nothing is sampled beside it.
double part_in_model(const Model& model, const field::OrientedBox& box) {
  const BoxBounds bounds(box), model_bounds = field_bounds(model);
  double part = 1.0;
  for (std::size_t a = 0; a < 3; ++a) {
    const double low = std::max(bounds.low[a], model_bounds.low[a]);
    const double high = std::min(bounds.high[a], model_bounds.high[a]);
    const double length = bounds.high[a] - bounds.low[a];
    if (length > 0.0) part *= std::clamp((high - low) / length, 0.0, 1.0);
  }
  return part;
}

}  // namespace

void announce_sampling(const Model& model, const field::OrientedBox& box, std::size_t count) {
  constexpr double kFewPoints = 1 << 27, kShort_s = 10, kLong_s = 600;
  constexpr double kSeconds_a_voxel = 8e-9;  // to write it, also beside the model
  constexpr std::size_t kFewBoxes = 10000;
  const double points = field::num_points(box) * static_cast<double>(count);
  if (points < kFewPoints && count < kFewBoxes) return;
  const field::OrientedBox part = small_part(model, box);
  const auto begin = std::chrono::steady_clock::now();
  sample_box(model, part);
  const std::chrono::duration<double> taken = std::chrono::steady_clock::now() - begin;
  const double in_model = part_in_model(model, box) / part_in_model(model, part);
  double writing_s = kSeconds_a_voxel * static_cast<double>(count);
  for (const std::int64_t side : box.size) writing_s *= static_cast<double>(side);
  const double seconds =
      taken.count() * points / field::num_points(part) * std::min(1.0, in_model) + writing_s;
  if (seconds < kShort_s) return;
  const std::string text =
      fmt::format("sampling {}{} × {} × {} voxels may take about {}",
                  count == 1 ? "" : fmt::format("{} times ", count), box.size[0], box.size[1],
                  box.size[2], base::time_text(seconds));
  seconds < kLong_s ? base::log_info(text) : base::log_warning(text);
}

std::size_t usual_decoded_bytes() {
  const std::size_t free = base::available_memory();
  return free == 0 ? std::numeric_limits<std::size_t>::max() : free / 4;
}

Model load_to_sample(const std::filesystem::path& path, std::size_t most_bytes) {
  return load_decoded_up_to(path, most_bytes);
}

void sample_box(const Model& model, const field::OrientedBox& box, const field::BoxSink& sink) {
  if (model.field)
    field::sample_box(*model.field, box, sink);
  else
    compact::sample_box(*model.coded, box, sink);
}

std::vector<float> sample_box(const Model& model, const field::OrientedBox& box) {
  return model.field ? field::sample_box(*model.field, box)
                     : compact::sample_box(*model.coded, box);
}

std::vector<float> sample_points(const Model& model, std::span<const field::Point> points) {
  return model.field ? field::sample_points(*model.field, points)
                     : compact::sample_points(*model.coded, points);
}

}  // namespace tomofield::output
