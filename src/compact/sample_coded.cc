#include "compact/sample_coded.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <memory>
#include <utility>

#include "base/system/memory.h"
#include "base/threads/parallel.h"
#include "compact/decoded_field.h"
#include "kernels/lanes.h"

namespace tomofield::compact {
namespace {

using field::OrientedBox;

constexpr std::int64_t kBandsAtOnce = 2;  // that rows of a box come from; two more are decoded

// Returns the band that has the density at y, or the nearest one.
int band_of(const field::RootGrid& roots, double y) {
  const double band = std::floor((y - field::kPixelCentre - static_cast<double>(roots.y0)) /
                                 static_cast<double>(roots.cell_size));
  return static_cast<int>(std::clamp(band, 0.0, static_cast<double>(roots.rows - 1)));
}

// Returns the bands that densities from y = low to high depend on. Leaves take vertices of their
// upper faces from the next band, and faces are softened on both sides.
base::Range bands_for(const field::RootGrid& roots, double low, double high) {
  return {std::max(band_of(roots, low) - 1, 0), std::min(band_of(roots, high) + 2, roots.rows)};
}

std::unique_ptr<field::Field> decode_bands(const CodedField& coded, double low, double high) {
  const CodedField bands = some_bands(coded, bands_for(coded.tree.roots(), low, high));
  const std::size_t bytes = decoded_bytes(bands.codes.shapes, base::thread_count());
  constexpr std::size_t kSmall = std::size_t{1} << 24;
  if (bytes > kSmall)
    base::require_memory(bytes, "this part of a compact model",
                         "use a machine with more, or ask for a smaller part");
  try {
    return decode_field(bands);
  } catch (const DamagedCode& damage) {
    throw Error(
        fmt::format("'{}' is a damaged model: {}; use another copy", coded.file, damage.what()));
  }
}

// Returns how many rows of a box, a multiple of those of a slab, some bands have.
std::int64_t rows_at_once(const CodedField& coded, const OrientedBox& box) {
  const auto rows = static_cast<double>(kBandsAtOnce * coded.tree.roots().cell_size) / box.voxel_px;
  return std::max<std::int64_t>(static_cast<std::int64_t>(rows) / kernels::kLanes, 1) *
         kernels::kLanes;
}

// Returns the smallest and the largest y of some rows of a box in the field.
std::pair<double, double> extent_of(const OrientedBox& box, base::Range rows) {
  double low = std::numeric_limits<double>::infinity(), high = -low;
  for (int corner = 0; corner < 8; ++corner) {
    const double y = box.position({(corner & 1) ? static_cast<double>(box.size[0]) : 0.0,
                                   static_cast<double>((corner & 2) ? rows.end : rows.begin),
                                   (corner & 4) ? static_cast<double>(box.size[2]) : 0.0})[1];
    low = std::min(low, y);
    high = std::max(high, y);
  }
  return {low, high};
}

// Says whether parts of a box reach nearly as far in y as the whole: then it is decoded at once.
bool is_turned_across(const OrientedBox& box, std::int64_t rows) {
  const auto reach = [&](std::int64_t end) {
    const auto [low, high] = extent_of(box, {0, static_cast<int>(end)});
    return high - low;
  };
  return 2 * reach(std::min(rows, box.size[1])) > reach(box.size[1]);
}

}  // namespace

void sample_box(const CodedField& coded, const OrientedBox& box, const field::BoxSink& sink) {
  field::require_feasible(box);
  std::int64_t step = rows_at_once(coded, box);
  if (is_turned_across(box, step)) step = box.size[1];
  for (std::int64_t first = 0; first < box.size[1]; first += step) {
    const base::Range rows{static_cast<int>(first),
                           static_cast<int>(std::min(first + step, box.size[1]))};
    const auto [low, high] = extent_of(box, rows);
    field::sample_box(*decode_bands(coded, low, high), box, rows, sink);
  }
}

std::vector<float> sample_box(const CodedField& coded, const OrientedBox& box) {
  return field::gather_box(box, [&](const field::BoxSink& sink) { sample_box(coded, box, sink); });
}

std::vector<float> sample_points(const CodedField& coded, std::span<const field::Point> points) {
  const field::RootGrid& roots = coded.tree.roots();
  std::vector<std::vector<std::size_t>> of_band(static_cast<std::size_t>(roots.rows));
  for (std::size_t i = 0; i < points.size(); ++i)
    of_band[static_cast<std::size_t>(band_of(roots, points[i][1]))].push_back(i);
  std::vector<float> values(points.size());
  for (const std::vector<std::size_t>& chosen : of_band) {
    if (chosen.empty()) continue;
    std::vector<field::Point> own;
    for (const std::size_t i : chosen) own.push_back(points[i]);
    const auto [low, high] =
        std::ranges::minmax(own, {}, [](const auto& point) { return point[1]; });
    const std::vector<float> densities =
        field::sample_points(*decode_bands(coded, low[1], high[1]), own);
    for (std::size_t i = 0; i < chosen.size(); ++i) values[chosen[i]] = densities[i];
  }
  return values;
}

}  // namespace tomofield::compact
