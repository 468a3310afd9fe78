#include "baseline/classical/slab_gradient.h"

#include <gtest/gtest.h>

#include <cmath>
#include <vector>

#include "base/random.h"
#include "baseline/voxel_volume.h"
#include "geometry/tilt_geometry.h"
#include "kernels/lanes.h"

namespace tomofield::baseline {
namespace {

using kernels::kLanes;
using projection::SampleSegment;

constexpr std::int64_t kRows = 37;  // two slabs and five rows

projection::SampleGrid grid_with_margins() {
  const auto geometry = geometry::centred_geometry(11, kRows, 7, {-40, 0, 40});
  return projection::make_sample_grid(geometry, 0, 11, 2);
}

// Calls body(slab, segment, i, k, lane, offset) for each voxel.
template <typename Body>
void for_each_voxel(const VoxelVolume& volume, Body&& body) {
  for (int slab = 0; slab < volume.num_slabs(); ++slab) {
    for (const SampleSegment& s : volume.grid().segments()) {
      for (int k = 0; k < s.nz; ++k) {
        for (int i = 0; i < s.nx; ++i) {
          for (int lane = 0; lane < volume.rows_in_slab(slab); ++lane)
            body(slab, s, i, k, lane, s.origin + k * s.stride_z() + i * kLanes + lane);
        }
      }
    }
  }
}

VoxelVolume random_volume(std::uint64_t seed) {
  VoxelVolume volume(grid_with_margins(), kRows);
  base::Random random(seed);
  for_each_voxel(volume, [&](int slab, const SampleSegment&, int, int, int, std::ptrdiff_t at) {
    volume.slab(slab)[at] = static_cast<float>(random.uniform(-1, 1));
  });
  return volume;
}

struct Gradients {
  VoxelVolume x{grid_with_margins(), kRows}, y{grid_with_margins(), kRows},
      z{grid_with_margins(), kRows};
};

constexpr GradientFactors kFactors{.x = 0.5f, .y = 2.0f, .z = 1.25f};

Gradients gradient(const VoxelVolume& volume) {
  Gradients result;
  for (int slab = 0; slab < volume.num_slabs(); ++slab) {
    const float* above = slab + 1 < volume.num_slabs() ? volume.slab(slab + 1) : nullptr;
    for (const SampleSegment& s : volume.grid().segments()) {
      for (int k = 0; k < s.nz; ++k) {
        const std::ptrdiff_t row = s.origin + k * s.stride_z();
        gradient_of_row(s, k, volume.rows_in_slab(slab), kFactors, volume.slab(slab), above,
                        result.x.slab(slab) + row, result.y.slab(slab) + row,
                        result.z.slab(slab) + row);
      }
    }
  }
  return result;
}

TEST(SlabGradient, OfARampIsItsSlopeAlsoBetweenSlabs) {
  VoxelVolume ramp(grid_with_margins(), kRows);
  for_each_voxel(
      ramp, [&](int slab, const SampleSegment&, int i, int k, int lane, std::ptrdiff_t at) {
        ramp.slab(slab)[at] = static_cast<float>(3 * i + 5 * (slab * kLanes + lane) - 4 * k);
      });
  const Gradients found = gradient(ramp);
  for_each_voxel(
      ramp, [&](int slab, const SampleSegment& s, int i, int k, int lane, std::ptrdiff_t at) {
        const bool last_row = slab * kLanes + lane + 1 == kRows;
        ASSERT_FLOAT_EQ(found.x.slab(slab)[at], i + 1 < s.nx ? 1.5f : 0.0f) << i;
        ASSERT_FLOAT_EQ(found.y.slab(slab)[at], last_row ? 0.0f : 10.0f) << slab << " " << lane;
        ASSERT_FLOAT_EQ(found.z.slab(slab)[at], k + 1 < s.nz ? -5.0f : 0.0f) << k;
      });
}

TEST(SlabGradient, LanesPastTheLastRowHaveNone) {
  const VoxelVolume volume = random_volume(1);
  const Gradients found = gradient(volume);
  const int last = volume.num_slabs() - 1;
  for_each_sample_row(volume.grid(), [&](const SampleSegment& s, std::ptrdiff_t row) {
    for (int i = 0; i < s.nx; ++i) {
      for (int lane = volume.rows_in_slab(last); lane < kLanes; ++lane) {
        const std::ptrdiff_t at = row + i * kLanes + lane;
        ASSERT_EQ(found.x.slab(last)[at], 0.0f);
        ASSERT_EQ(found.y.slab(last)[at], 0.0f);
        ASSERT_EQ(found.z.slab(last)[at], 0.0f);
      }
    }
  });
}

TEST(SlabGradient, AdjointIsTheTransposeAlsoBetweenSlabs) {
  const VoxelVolume volume = random_volume(1);
  const Gradients grad = gradient(volume);
  Gradients dual{random_volume(2), random_volume(3), random_volume(4)};
  double forward = 0;
  for_each_voxel(volume, [&](int slab, const SampleSegment& s, int i, int k, int lane,
                             std::ptrdiff_t at) {
    if (i + 1 == s.nx) dual.x.slab(slab)[at] = 0;
    if (slab * kLanes + lane + 1 == kRows) dual.y.slab(slab)[at] = 0;
    if (k + 1 == s.nz) dual.z.slab(slab)[at] = 0;
    for (const auto& [a, b] : {std::pair{&grad.x, &dual.x}, {&grad.y, &dual.y}, {&grad.z, &dual.z}})
      forward += static_cast<double>(a->slab(slab)[at]) * static_cast<double>(b->slab(slab)[at]);
  });

  VoxelVolume adjoint(grid_with_margins(), kRows);
  for (int slab = 0; slab < volume.num_slabs(); ++slab) {
    for (const SampleSegment& s : volume.grid().segments()) {
      for (int k = 0; k < s.nz; ++k) {
        add_gradient_adjoint_of_row(s, k, kFactors, dual.x.slab(slab), dual.y.slab(slab),
                                    dual.z.slab(slab), slab > 0 ? dual.y.slab(slab - 1) : nullptr,
                                    adjoint.slab(slab));
      }
    }
  }
  double backward = 0, size = 0;
  for_each_voxel(volume, [&](int slab, const SampleSegment&, int, int, int, std::ptrdiff_t at) {
    const double product =
        static_cast<double>(volume.slab(slab)[at]) * static_cast<double>(adjoint.slab(slab)[at]);
    backward += product;
    size += std::abs(product);
  });
  EXPECT_NEAR(forward, backward, 1e-6 * size);
}

}  // namespace
}  // namespace tomofield::baseline
