#include "output/sampling_time.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <chrono>
#include <cmath>
#include <cstdint>
#include <numbers>
#include <string>

#include "base/log.h"
#include "base/progress.h"
#include "output/box_bounds.h"
#include "output/sample_model.h"

namespace tomofield::output {
namespace {

using field::OrientedBox;
using field::Point;

// Returns the part of a box, in its voxels, that may meet the model: the bounds of the model's
// corners there.
BoxBounds part_of_box(const OrientedBox& box, const BoxBounds& model) {
  BoxBounds part({INFINITY, INFINITY, INFINITY}, {-INFINITY, -INFINITY, -INFINITY});
  for (int corner = 0; corner < 8; ++corner) {
    for (std::size_t a = 0; a < 3; ++a) {
      double at = 0.5 * static_cast<double>(box.size[a]);
      for (std::size_t b = 0; b < 3; ++b)
        at += box.field_from_box[b][a] *
              ((corner >> b & 1 ? model.high[b] : model.low[b]) - box.centre_px[b]) / box.voxel_px;
      part.low[a] = std::min(part.low[a], at);
      part.high[a] = std::max(part.high[a], at);
    }
  }
  for (std::size_t a = 0; a < 3; ++a) {
    const auto size = static_cast<double>(box.size[a]);
    part.low[a] = std::clamp(part.low[a], 0.0, size);
    part.high[a] = std::clamp(part.high[a], 0.0, size);
  }
  return part;
}

// Returns how much of a part of a box lies within bounds of the field, at points of a lattice.
double share_within(const OrientedBox& box, const BoxBounds& part, const BoxBounds& bounds) {
  constexpr int kPoints = 8;  // along an axis
  int count = 0;
  for (int i = 0; i < kPoints * kPoints * kPoints; ++i) {
    const std::array<int, 3> place{i % kPoints, i / kPoints % kPoints, i / kPoints / kPoints};
    Point voxel{};
    for (std::size_t a = 0; a < 3; ++a)
      voxel[a] = part.low[a] + (part.high[a] - part.low[a]) * (place[a] + 0.5) / kPoints;
    const Point at = box.position(voxel);
    bool is_within = true;
    for (std::size_t a = 0; a < 3; ++a)
      is_within = is_within && at[a] >= bounds.low[a] && at[a] <= bounds.high[a];
    count += is_within ? 1 : 0;
  }
  return static_cast<double>(count) / (kPoints * kPoints * kPoints);
}

// Returns about the number of points of a box that are evaluated: those in the model, and in voxels
// of a turned box that reach into it.
double points_in_model(const BoxBounds& model, const OrientedBox& box) {
  BoxBounds bounds = model;
  const double reach_px = box.is_aligned() ? 0.0 : std::numbers::sqrt3 / 2 * box.voxel_px;
  for (std::size_t a = 0; a < 3; ++a) {
    bounds.low[a] -= reach_px;
    bounds.high[a] += reach_px;
  }
  const BoxBounds part = part_of_box(box, bounds);
  double points = std::pow(static_cast<double>(field::points_per_voxel(box)), 3);
  for (std::size_t a = 0; a < 3; ++a) points *= part.high[a] - part.low[a];
  return points == 0.0 ? 0.0 : points * share_within(box, part, bounds);
}

// Returns a small box of voxels like those of another one, where that meets the model or else in
// its middle.
OrientedBox small_part(const BoxBounds& model, const OrientedBox& box) {
  constexpr double kMostPoints = 1 << 20, kLargestVoxel_px = 64;
  OrientedBox part = box;
  part.voxel_px = std::min(box.voxel_px, kLargestVoxel_px);
  const BoxBounds bounds(box);
  for (std::size_t a = 0; a < 3; ++a) {
    const double low = std::max(bounds.low[a], model.low[a]);
    const double high = std::min(bounds.high[a], model.high[a]);
    if (low < high) part.centre_px[a] = (low + high) / 2;
  }
  while (field::num_points(part) > kMostPoints && *std::ranges::max_element(part.size) > 1) {
    std::int64_t& side = *std::ranges::max_element(part.size);
    side = (side + 1) / 2;
  }
  return part;
}

// Returns about the seconds that a point in the model takes in boxes like this one.
double seconds_a_point(const Model& model, const BoxBounds& bounds, const OrientedBox& box) {
  const OrientedBox part = small_part(bounds, box);
  const auto begin = std::chrono::steady_clock::now();
  sample_box(model, part);
  const std::chrono::duration<double> taken = std::chrono::steady_clock::now() - begin;
  return taken.count() / std::max(1.0, points_in_model(bounds, part));
}

// Tells how many points some boxes have in the model, and which box has the most.
struct Work {
  double points = 0.0;
  const OrientedBox* fullest = {};
};

Work work_of(const BoxBounds& model, std::span<const OrientedBox> boxes) {
  constexpr std::size_t kCounted = 1000;
  const std::size_t step = (boxes.size() + kCounted - 1) / kCounted;
  Work work{.fullest = &boxes.front()};
  double most = 0.0;
  for (std::size_t i = 0; i < boxes.size(); i += step) {
    const double points = points_in_model(model, boxes[i]);
    work.points += points * static_cast<double>(std::min(step, boxes.size() - i));
    if (points > most) work.fullest = &boxes[i];
    most = std::max(most, points);
  }
  return work;
}

}  // namespace

void announce_sampling(const Model& model, std::span<const OrientedBox> boxes) {
  constexpr double kFewPoints = 1 << 27, kFewTurnedPoints = 1 << 24, kShort_s = 10, kLong_s = 600;
  constexpr double kSeconds_a_voxel = 8e-9;  // to write it, also beside the model
  constexpr std::size_t kFewBoxes = 10000;
  const auto count = static_cast<double>(boxes.size());
  const auto& [nx, ny, nz] = boxes.front().size;
  const double few = boxes.front().is_aligned() ? kFewPoints : kFewTurnedPoints;
  if (field::num_points(boxes.front()) * count < few && boxes.size() < kFewBoxes) return;
  const BoxBounds bounds = field_bounds(model);
  const Work work = work_of(bounds, boxes);
  const double voxels =
      count * static_cast<double>(nx) * static_cast<double>(ny) * static_cast<double>(nz);
  const double seconds =
      work.points * seconds_a_point(model, bounds, *work.fullest) + voxels * kSeconds_a_voxel;
  if (seconds < kShort_s) return;
  const std::string text =
      fmt::format("sampling {}{} × {} × {} voxels may take about {}",
                  boxes.size() == 1 ? "" : fmt::format("{} times ", boxes.size()), nx, ny, nz,
                  base::time_text(seconds));
  seconds < kLong_s ? base::log_info(text) : base::log_warning(text);
}

}  // namespace tomofield::output
