#include "field/sampling/aligned_rows.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <utility>

#include "field/sampling/resample.h"
#include "kernels/lanes.h"
#include "kernels/leaf_decoding.h"

namespace tomofield::field {
namespace {

using kernels::kLanes;

float* sample_scratch(std::size_t size) {
  thread_local base::AlignedBuffer<float> buffer;
  buffer.reserve(size);
  return buffer.data();
}

}  // namespace

AlignedRows::AlignedRows(const Field& field, const OrientedBox& box)
    : field_(field), box_(box), factor_(points_per_voxel(box)) {
  const std::int64_t num_z = box.size[2] * factor_;
  while (first_z_ < num_z && coordinate(2, first_z_) < 0) ++first_z_;
  end_z_ = first_z_;
  while (end_z_ < num_z && coordinate(2, end_z_) <= field.thickness()) ++end_z_;
  for (const LeafShape& shape : field.shapes()) {
    const auto [found, is_new] = taps_z_.try_emplace(shape.nz);
    for (std::int64_t z = first_z_; is_new && z < end_z_; ++z) {
      const AxisPoint at(
          (coordinate(2, z) - kPixelCentre) / vertex_height(field.thickness()) * (shape.nz - 1),
          shape.nz);
      found->second.lower.push_back(static_cast<int>(at.lower));
      found->second.fraction.push_back(static_cast<float>(at.fraction));
    }
  }
}

std::int64_t AlignedRows::rows_at_once() const {
  return std::max<std::int64_t>(1, kLanes / factor_);
}

double AlignedRows::coordinate(int axis, std::int64_t point) const {
  Point voxel{};
  voxel[static_cast<std::size_t>(axis)] =
      (static_cast<double>(point) + 0.5) / static_cast<double>(factor_);
  return box_.position(voxel)[static_cast<std::size_t>(axis)];
}

std::vector<AlignedRows::LeafRows> AlignedRows::contract(std::int64_t first_row,
                                                         std::int64_t num_rows) const {
  std::vector<LeafRows> leaves;
  const std::int64_t first = first_row * factor_, end = first + num_rows * factor_;
  for (std::int64_t lanes = first; lanes < end; lanes += kLanes) {
    const int num_lanes = static_cast<int>(std::min<std::int64_t>(kLanes, end - lanes));
    contract_lanes(first, lanes, num_lanes, leaves);
  }
  return leaves;
}

void AlignedRows::contract_lanes(std::int64_t block_first, std::int64_t lanes_first, int num_lanes,
                                 std::vector<LeafRows>& leaves) const {
  std::array<double, kLanes> y{};
  for (int l = 0; l < kLanes; ++l)
    y[static_cast<std::size_t>(l)] = coordinate(1, lanes_first + std::min(l, num_lanes - 1));
  const auto low = static_cast<std::int64_t>(std::floor(y.front() - kPixelCentre));
  const auto high = static_cast<std::int64_t>(std::floor(y.back() + kPixelCentre)) + 1;
  for (const int leaf : field_.tree().leaves_across(low, high)) {
    const Quadtree::Bounds bounds = field_.tree().bounds(field_.tree().leaf(leaf).square);
    const LeafShape& shape = field_.shape(leaf);
    LeafRows rows;
    rows.leaf = leaf;
    rows.first_point_row = lanes_first - block_first;
    const auto lane_at = [&](double edge) {
      return static_cast<int>(std::lower_bound(y.begin(), y.begin() + num_lanes, edge) - y.begin());
    };
    rows.first_lane = lane_at(bounds.y0);
    rows.end_lane = lane_at(bounds.y1);
    if (rows.first_lane >= rows.end_lane) continue;
    for (std::int64_t i = 0; i < box_.size[0] * factor_; ++i) {
      const double x = coordinate(0, i);
      if (x < bounds.x0 || x >= bounds.x1) continue;
      if (rows.lower_x.empty()) rows.first_point_x = i;
      const AxisPoint at(field_.vertex_x(leaf, x), shape.nx);
      rows.lower_x.push_back(static_cast<int>(at.lower));
      rows.fraction_x.push_back(static_cast<float>(at.fraction));
    }
    if (rows.lower_x.empty()) continue;
    rows.values.reset(shape.vertices_xz() * kLanes);
    field_.slab_values(leaf, field_.lane_rows(leaf, y), rows.values.data());
    leaves.push_back(std::move(rows));
  }
}

void AlignedRows::decode(const std::vector<LeafRows>& leaves, std::int64_t first,
                         std::int64_t count, std::int64_t num_rows, float* voxels) const {
  const std::int64_t first_z = std::max(first * factor_, first_z_);
  const std::int64_t num_z = std::min((first + count) * factor_, end_z_) - first_z;
  if (num_z <= 0) return;
  // Columns are decoded in batches that stay in L2.
  constexpr std::int64_t kScratch = std::int64_t{1} << 17;
  const std::int64_t num_x = std::max<std::int64_t>(1, kScratch / (num_z * kLanes));
  for (const LeafRows& rows : leaves) {
    const int num_vertices = field_.shape(rows.leaf).nz;
    const TapsZ& taps = taps_z_.at(num_vertices);
    const std::int64_t width = static_cast<std::int64_t>(rows.lower_x.size());
    for (std::int64_t x = 0; x < width; x += num_x) {
      const std::int64_t columns = std::min(num_x, width - x);
      float* samples = sample_scratch(static_cast<std::size_t>(num_z * columns * kLanes));
      const kernels::LeafPiece piece{
          .num_vertices_z = num_vertices,
          .x = {static_cast<int>(columns), rows.lower_x.data() + x, rows.fraction_x.data() + x},
          .z = {static_cast<int>(num_z), taps.lower.data() + (first_z - first_z_),
                taps.fraction.data() + (first_z - first_z_)},
          .stride_z = columns * kLanes,
          .activation = field_.activation};
      kernels::decode_leaf(piece, rows.values.data(), samples);
      add_samples(rows, x, columns, first_z, num_z, samples, first, num_rows, voxels);
    }
  }
}

void AlignedRows::add_samples(const LeafRows& rows, std::int64_t first_x, std::int64_t num_x,
                              std::int64_t first_z, std::int64_t num_z, const float* samples,
                              std::int64_t first_section, std::int64_t num_rows,
                              float* voxels) const {
  const std::int64_t nx = box_.size[0];
  const auto points = static_cast<double>(factor_ * factor_ * factor_);
  const float share = static_cast<float>(1.0 / points);
  for (std::int64_t z = 0; z < num_z; ++z) {
    float* section = voxels + ((first_z + z) / factor_ - first_section) * num_rows * nx;
    for (int lane = rows.first_lane; lane < rows.end_lane; ++lane) {
      float* row = section + (rows.first_point_row + lane) / factor_ * nx;
      const float* sample = samples + z * num_x * kLanes + lane;
      const std::int64_t point_x = rows.first_point_x + first_x;
      if (factor_ == 1) {
        for (std::int64_t x = 0; x < num_x; ++x) row[point_x + x] = sample[x * kLanes];
      } else {
        for (std::int64_t x = 0; x < num_x; ++x)
          row[(point_x + x) / factor_] += share * sample[x * kLanes];
      }
    }
  }
}

}  // namespace tomofield::field
