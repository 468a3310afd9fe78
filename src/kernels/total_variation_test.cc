#include "kernels/total_variation.h"

#include <gtest/gtest.h>

#include <cmath>
#include <vector>

#include "kernels/lanes.h"
#include "kernels/reference/reference_kernels.h"
#include "random_arrays.h"
#include "simd_targets.h"

namespace tomofield::kernels {
namespace {

using reference::VolumeVariation;
using testing::expect_near;
using testing::for_each_simd_target;

struct Result {
  double value;
  std::vector<double> gradient;  // [z, x, y]
};

Result from_reference(const VolumeVariation& shape, const std::vector<float>& volume) {
  Result r{0.0, std::vector<double>(volume.size())};
  const auto values = testing::to_double(volume);
  r.value = reference::volume_variation(shape, values.data(), r.gradient.data());
  return r;
}

// The volume cut into slabs. Each slab is in an unaligned, padded buffer whose lanes past the
// volume's end hold arbitrary values.
class Slabs {
 public:
  Slabs(const VolumeVariation& shape, const std::vector<float>& volume)
      : shape_(shape),
        stride_z_((shape.nx + 1) * kLanes + 3),
        flux_(static_cast<std::size_t>(shape.nx * shape.nz), 0.0f) {
    for (int y0 = 0; y0 < shape.ny; y0 += kLanes) {
      auto& slab = samples_.emplace_back(
          testing::random_floats(static_cast<std::size_t>(2 + stride_z_ * shape.nz), 3));
      for_each_sample(y0, [&](std::size_t in_slab, std::size_t in_volume) {
        slab[in_slab] = volume[in_volume];
      });
    }
  }

  // Length of the ranges along x, in samples, that are computed by themselves.
  int range = 1 << 20;

  // Computes the slabs from `first` on. The flux of the row before comes from the last run or from
  // start_band_at().
  Result run(std::size_t first = 0) {
    Result r{0.0, std::vector<double>(static_cast<std::size_t>(shape_.nx * shape_.ny * shape_.nz))};
    for (std::size_t s = first; s < samples_.size(); ++s) {
      std::vector<float> above(flux_.size());
      const bool is_last = s + 1 == samples_.size();
      if (!is_last) copy_row(s + 1, 0, above);
      std::vector<float> gradient(samples_[s].size(), 0.25f);
      SlabVariation v = settings();
      v.samples = samples_[s].data() + 1;
      v.gradient = gradient.data() + 1;
      v.num_rows = std::min(kLanes, shape_.ny - static_cast<int>(s) * kLanes);
      if (!is_last) v.above = {above.data(), shape_.nz, 1};
      v.flux = flux_.data();
      for (int x = 0; x < shape_.nx; x += range) {
        v.x = {x, std::min(x + range, shape_.nx)};
        r.value += slab_variation(v);
      }
      for_each_sample(static_cast<int>(s) * kLanes, [&](std::size_t in_slab, std::size_t at) {
        r.gradient[at] = static_cast<double>(gradient[in_slab]) - 0.25;
        gradient[in_slab] = 0.25f;
      });
      // Nothing may be written beside the volume's samples.
      for (const float g : gradient) EXPECT_EQ(g, 0.25f);
    }
    return r;
  }

  void start_band_at(std::size_t slab) {
    std::vector<float> row(flux_.size()), next(flux_.size());
    copy_row(slab - 1, kLanes - 1, row);
    copy_row(slab, 0, next);
    row_flux(settings(), {row.data(), shape_.nz, 1}, {next.data(), shape_.nz, 1}, flux_.data());
  }

 private:
  SlabVariation settings() const {
    SlabVariation v;
    v.nx = shape_.nx;
    v.nz = shape_.nz;
    v.x = {0, shape_.nx};
    v.stride_z = stride_z_;
    v.per_hx = static_cast<float>(shape_.per_hx);
    v.per_hz = static_cast<float>(shape_.per_hz);
    v.weight = static_cast<float>(shape_.weight);
    v.penalty = shape_.penalty;
    v.backward_x = shape_.backward_x;
    v.backward_z = shape_.backward_z;
    return v;
  }

  template <typename Visit>
  void for_each_sample(int y0, Visit&& visit) const {
    for (int z = 0; z < shape_.nz; ++z) {
      for (int x = 0; x < shape_.nx; ++x) {
        for (int y = y0; y < std::min(y0 + kLanes, shape_.ny); ++y) {
          visit(static_cast<std::size_t>(1 + z * stride_z_ + x * kLanes + y - y0),
                static_cast<std::size_t>((z * shape_.nx + x) * shape_.ny + y));
        }
      }
    }
  }

  void copy_row(std::size_t slab, int lane, std::vector<float>& row) const {
    for (int x = 0; x < shape_.nx; ++x) {
      for (int z = 0; z < shape_.nz; ++z) {
        row[static_cast<std::size_t>(x * shape_.nz + z)] =
            samples_[slab][static_cast<std::size_t>(1 + z * stride_z_ + x * kLanes + lane)];
      }
    }
  }

  VolumeVariation shape_;
  std::ptrdiff_t stride_z_;
  std::vector<float> flux_;
  std::vector<std::vector<float>> samples_;
};

std::vector<float> random_volume(const VolumeVariation& s) {
  return testing::random_floats(static_cast<std::size_t>(s.nx * s.ny * s.nz), 8, 0.0, 1.0);
}

const std::vector<VariationPenalty> kPenalties = {{1e-3f, 0.0f}, {0.1f, 0.0f}, {1e-2f, 0.05f}};

void compare_one(const VolumeVariation& shape) {
  SCOPED_TRACE(::testing::Message()
               << shape.nx << " x " << shape.ny << " x " << shape.nz << ", concavity "
               << shape.penalty.concavity << ", backward " << shape.backward_x << shape.backward_z);
  const auto volume = random_volume(shape);
  const Result expected = from_reference(shape, volume);
  for (const int range : {shape.nx, 3, 1}) {
    Slabs slabs(shape, volume);
    slabs.range = range;
    const Result found = slabs.run();
    EXPECT_NEAR(found.value, expected.value, 2e-6 * expected.value);
    expect_near({found.gradient.begin(), found.gradient.end()}, expected.gradient,
                4e-6 * shape.weight * (shape.per_hx + shape.per_hz + 1));
  }
}

void compare(VolumeVariation shape) {
  for (const bool backward_x : {false, true}) {
    for (const bool backward_z : {false, true}) {
      shape.backward_x = backward_x;
      shape.backward_z = backward_z;
      compare_one(shape);
    }
  }
}

TEST(SlabVariation, SlabsWithHalosAreOneVolume) {
  for_each_simd_target([] {
    for (const VariationPenalty& penalty : kPenalties) {
      for (const int ny : {1, 3, 15, 16, 17, 33, 48}) {
        compare({.nx = 7, .ny = ny, .nz = 3, .weight = 0.7, .penalty = penalty});
      }
      compare({.nx = 1, .ny = 20, .nz = 17, .per_hz = 0.25, .weight = 2.0, .penalty = penalty});
      compare({.nx = 33, .ny = 20, .nz = 1, .per_hx = 2.0, .weight = 2.0, .penalty = penalty});
    }
  });
}

TEST(SlabVariation, ABandStartsWithTheFluxOfTheRowBefore) {
  for_each_simd_target([] {
    for (const VariationPenalty& penalty : kPenalties) {
      const VolumeVariation shape{.nx = 7,
                                  .ny = 40,
                                  .nz = 5,
                                  .per_hx = 0.5,
                                  .per_hz = 2.0,
                                  .weight = 0.7,
                                  .penalty = penalty,
                                  .backward_x = true,
                                  .backward_z = penalty.concavity > 0};
      const auto volume = random_volume(shape);
      const Result expected = from_reference(shape, volume);
      Slabs slabs(shape, volume);
      slabs.start_band_at(1);
      const Result found = slabs.run(1);
      for (int zx = 0; zx < shape.nx * shape.nz; ++zx) {
        for (int y = kLanes; y < shape.ny; ++y) {
          const auto at = static_cast<std::size_t>(zx * shape.ny + y);
          ASSERT_NEAR(found.gradient[at], expected.gradient[at], 1e-5) << "row " << y;
        }
      }
    }
  });
}

// Checks the reference's gradient, with which the kernels are compared above, against its own
// value.
TEST(SlabVariation, TheReferencesGradientIsTheDerivative) {
  for (const VariationPenalty& penalty : kPenalties) {
    const VolumeVariation shape{
        .nx = 4, .ny = 5, .nz = 3, .per_hx = 0.5, .per_hz = 2.0, .weight = 0.7, .penalty = penalty};
    const auto volume = testing::to_double(random_volume(shape));
    std::vector<double> gradient(volume.size()), ignored(volume.size());
    reference::volume_variation(shape, volume.data(), gradient.data());
    for (std::size_t i = 0; i < volume.size(); ++i) {
      auto moved = volume;
      moved[i] = volume[i] + 1e-6;
      const double up = reference::volume_variation(shape, moved.data(), ignored.data());
      moved[i] = volume[i] - 1e-6;
      const double down = reference::volume_variation(shape, moved.data(), ignored.data());
      EXPECT_NEAR(gradient[i], (up - down) / 2e-6, 1e-5);
    }
  }
}

TEST(SlabVariation, AConstantVolumeHasNoGradientAndTheSmallestValue) {
  for_each_simd_target([] {
    const VolumeVariation shape{
        .nx = 9, .ny = 20, .nz = 4, .weight = 2.0, .penalty = {1e-3f, 0.0f}};
    const std::vector<float> volume(9 * 20 * 4, 0.6f);
    const Result found = Slabs(shape, volume).run();
    EXPECT_NEAR(found.value, 2.0 * 1e-3 * 9 * 20 * 4, 1e-6);
    for (const double g : found.gradient) ASSERT_EQ(g, 0.0);
  });
}

TEST(SlabVariation, GreatStepsUnderAConcavePenaltyStayFinite) {
  for_each_simd_target([] {
    const VolumeVariation shape{
        .nx = 5, .ny = 16, .nz = 4, .weight = 1.0, .penalty = {1e-3f, 1e-3f}};
    auto volume = random_volume(shape);
    for (float& v : volume) v *= 1e5f;
    const Result expected = from_reference(shape, volume);
    EXPECT_NEAR(Slabs(shape, volume).run().value, expected.value, 1e-5 * expected.value);
  });
}

}  // namespace
}  // namespace tomofield::kernels
