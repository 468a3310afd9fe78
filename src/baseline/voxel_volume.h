#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <numeric>
#include <utility>
#include <vector>

#include "base/aligned_buffer.h"
#include "base/threads/parallel.h"
#include "kernels/lanes.h"
#include "projection/sample_grid.h"
#include "projection/slab_projector.h"

namespace tomofield::baseline {

/// Two slabs that are projected together, which takes less time: an even one and the one after it,
/// unless that is past the end.
struct SlabPair {
  static constexpr int kMaxSlabs = projection::SlabProjector::kSlabsTogether;
  int first = 0, count = 1;
  int end() const { return first + count; }
  std::size_t index() const { return static_cast<std::size_t>(first / kMaxSlabs); }
  static int number(int num_slabs) { return (num_slabs + kMaxSlabs - 1) / kMaxSlabs; }
};

/// A volume whose voxels are the samples of the projector, slab after slab. Each slab is a buffer
/// [segment][z][x][lane] of a SampleGrid, zero at first. Padding and the lanes past the last row
/// are no voxels and stay zero.
class VoxelVolume {
 public:
  VoxelVolume(projection::SampleGrid grid, std::int64_t num_rows)
      : grid_(std::move(grid)),
        num_rows_(num_rows),
        samples_(static_cast<std::size_t>(num_slabs()) * grid_.size()) {}

  const projection::SampleGrid& grid() const { return grid_; }
  std::int64_t num_rows() const { return num_rows_; }
  int num_slabs() const {
    return static_cast<int>((num_rows_ + kernels::kLanes - 1) / kernels::kLanes);
  }
  /// Returns the number of lanes of a slab that are rows of the volume: 16, or fewer in the last
  /// slab.
  int rows_in_slab(int slab) const {
    return static_cast<int>(
        std::min<std::int64_t>(kernels::kLanes, num_rows_ - std::int64_t{slab} * kernels::kLanes));
  }

  void fill(float density) {
    base::parallel_for("slabs of volume", num_slabs(), [&](std::int64_t index) {
      const int s = static_cast<int>(index);
      for (const projection::SampleSegment& segment : grid_.segments()) {
        for (int k = 0; k < segment.nz; ++k) {
          float* row = slab(s) + segment.origin + k * segment.stride_z();
          for (std::ptrdiff_t i = 0; i < segment.nx; ++i)
            std::fill_n(row + i * kernels::kLanes, rows_in_slab(s), density);
        }
      }
    });
  }

  float* slab(int index) {
    return samples_.data() + static_cast<std::size_t>(index) * grid_.size();
  }
  const float* slab(int index) const {
    return samples_.data() + static_cast<std::size_t>(index) * grid_.size();
  }

 private:
  projection::SampleGrid grid_;
  std::int64_t num_rows_;
  base::AlignedBuffer<float> samples_;
};

/// Calls body(segment, row) for each z row of a slab's samples. `row` is the index of sample (0, k,
/// lane 0) in a slab buffer; the nx · kLanes floats from there on are the row's samples.
template <typename Body>
void for_each_sample_row(const projection::SampleGrid& grid, Body&& body) {
  for (const projection::SampleSegment& segment : grid.segments()) {
    for (int k = 0; k < segment.nz; ++k) body(segment, segment.origin + k * segment.stride_z());
  }
}

/// Returns the number of voxels of all slabs, with the margins.
inline std::size_t num_voxels(const projection::SampleGrid& grid, std::int64_t num_rows) {
  std::size_t count = 0;
  for (const projection::SampleSegment& segment : grid.segments())
    count += static_cast<std::size_t>(segment.nx) * static_cast<std::size_t>(segment.nz);
  return count * static_cast<std::size_t>(num_rows);
}

/// Calls body(pair) for every SlabPair, in any order and on any thread.
template <typename Body>
void for_each_pair(int num_slabs, Body&& body) {
  base::parallel_for("pairs of slabs", SlabPair::number(num_slabs), [&](std::int64_t index) {
    const int first = SlabPair::kMaxSlabs * static_cast<int>(index);
    body(SlabPair{first, std::min(SlabPair::kMaxSlabs, num_slabs - first)});
  });
}

/// Returns the sum of body(pair) over all pairs, added in their order whatever the thread count.
template <typename Body>
double sum_over_pairs(int num_slabs, Body&& body) {
  std::vector<double> parts(static_cast<std::size_t>(SlabPair::number(num_slabs)));
  for_each_pair(num_slabs, [&](const SlabPair& pair) { parts[pair.index()] = body(pair); });
  return std::accumulate(parts.begin(), parts.end(), 0.0);
}

/// Returns the sum of body(slab) over all slabs, added in their order whatever the thread count.
template <typename Body>
double sum_over_slabs(int num_slabs, Body&& body) {
  std::vector<double> parts(static_cast<std::size_t>(num_slabs));
  base::parallel_for("sum of slabs", num_slabs, [&](std::int64_t slab) {
    parts[static_cast<std::size_t>(slab)] = body(static_cast<int>(slab));
  });
  return std::accumulate(parts.begin(), parts.end(), 0.0);
}

}  // namespace tomofield::baseline
