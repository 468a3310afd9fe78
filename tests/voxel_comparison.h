#pragma once

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <limits>

#include "base/threads/parallel.h"
#include "baseline/voxel_problem.h"
#include "baseline/voxel_volume.h"
#include "kernels/lanes.h"
#include "sphere_series.h"

namespace tomofield::testing {

/// Runs a test with one thread: problems of two slabs are no work for several. A test may set its
/// own number.
class OneThread : public ::testing::Test {
 protected:
  OneThread() { base::set_thread_count(1); }
  ~OneThread() override { base::set_thread_count(0); }
};

/// Returns the problem of a sphere series without margins: nothing lies outside. `series` must
/// outlive it.
inline baseline::VoxelProblem voxel_problem(const SphereSeries& series,
                                            const baseline::ViewHandling& handling = {}) {
  return {series.geometry,
          projection::make_sample_grid(series.geometry, 0, SphereSeries::kWidth, 0), *series.rays,
          series.noise_sigma, handling};
}

/// Calls body(x, y, z, density) for each voxel of the region of interest.
template <typename Body>
void for_each_density(const baseline::VoxelVolume& volume, Body&& body) {
  const projection::SampleSegment& s = volume.grid().segments().front();
  for (int y = 0; y < static_cast<int>(volume.num_rows()); ++y) {
    const float* slab = volume.slab(y / kernels::kLanes) + s.origin + y % kernels::kLanes;
    for (int z = 0; z < s.nz; ++z) {
      for (int x = 0; x < s.nx; ++x) body(x, y, z, slab[z * s.stride_z() + x * kernels::kLanes]);
    }
  }
}

/// Returns the root mean square distance between a volume and the spheres.
inline double rms_error(const baseline::VoxelVolume& volume) {
  double squares = 0, count = 0;
  for_each_density(volume, [&](int x, int y, int z, float density) {
    const double error = static_cast<double>(density) - SphereSeries::truth(x, y, z);
    squares += error * error;
    count += 1;
  });
  return std::sqrt(squares / count);
}

/// Returns the root mean square of the spheres themselves: the error of an empty volume.
inline double rms_truth() {
  double squares = 0, count = 0;
  for (int z = 0; z < SphereSeries::kThickness; ++z) {
    for (int y = 0; y < SphereSeries::kRows; ++y) {
      for (int x = 0; x < SphereSeries::kWidth; ++x) {
        squares += std::pow(SphereSeries::truth(x, y, z), 2);
        count += 1;
      }
    }
  }
  return std::sqrt(squares / count);
}

inline float lowest(const baseline::VoxelVolume& volume) {
  float result = std::numeric_limits<float>::infinity();
  for_each_density(volume,
                   [&](int, int, int, float density) { result = std::min(result, density); });
  return result;
}

inline bool same_bits(const baseline::VoxelVolume& a, const baseline::VoxelVolume& b) {
  for (int slab = 0; slab < a.num_slabs(); ++slab) {
    if (std::memcmp(a.slab(slab), b.slab(slab), a.grid().size() * sizeof(float)) != 0) return false;
  }
  return true;
}

}  // namespace tomofield::testing
