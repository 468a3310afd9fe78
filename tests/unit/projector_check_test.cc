// Tests the slab projector against another group's simulated projections.

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <filesystem>
#include <fstream>
#include <span>
#include <vector>

#include "io/images/mrc.h"
#include "kernels/lanes.h"
#include "projected_slab.h"
#include "shared_data.h"

namespace tomofield::projection {
namespace {

using geometry::centred_geometry;
using geometry::TiltGeometry;
using kernels::kLanes;
using testing::for_each_sample;
using testing::project_slab;

// Reads a 64³ truth [z, y, x] and its 41 linear projections [view, y, x]. Of all orders of axes
// only this one correlates at every angle.
class ProjectorCheck : public ::testing::Test {
 protected:
  static constexpr std::int64_t kSize = 64;
  using Volume = std::vector<float>;

  void SetUp() override {
    const std::filesystem::path folder = testing::shared_data() / "projector_check";
    if (!std::filesystem::exists(folder)) GTEST_SKIP() << folder << " is not here";
    truth_ = read(folder / "mg_ground_truth_amorphous_vol.mrc");
    projections_ = read(folder / "mg_sample_projections_amorphous.mrc");
    std::ifstream angles(folder / "mg_sample_angles_amorphous.txt");
    double phi, theta, psi;
    while (angles >> phi >> theta >> psi) tilt_deg_.push_back(theta);
    ASSERT_EQ(projections_.size(), tilt_deg_.size() * kSize * kSize);
  }

  static Volume read(const std::filesystem::path& path) {
    const io::MrcReader reader(path);
    Volume volume(static_cast<std::size_t>(reader.header().nz * kSize * kSize));
    for (std::int64_t s = 0; s < reader.header().nz; ++s) {
      reader.read_section(
          s, std::span(volume).subspan(static_cast<std::size_t>(s * kSize * kSize), kSize * kSize));
    }
    return volume;
  }

  // Returns our projections [view, y, x].
  Volume project_truth(const TiltGeometry& g) const {
    const SampleGrid grid = make_sample_grid(g, 0, kSize, 0);
    Volume images(projections_.size());
    for (std::int64_t slab = 0; slab < kSize / kLanes; ++slab) {
      std::vector<float> samples(grid.size());
      for_each_sample(grid, [&](std::size_t at, const SampleSegment&, int i, int k, int l) {
        samples[at] = truth_[static_cast<std::size_t>((k * kSize + slab * kLanes + l) * kSize + i)];
      });
      const auto detector = project_slab(g, grid, samples);
      for (std::int64_t v = 0; v < g.num_views(); ++v) {
        for (std::int64_t u = 0; u < kSize; ++u) {
          for (int l = 0; l < kLanes; ++l) {
            images[static_cast<std::size_t>((v * kSize + slab * kLanes + l) * kSize + u)] =
                detector[static_cast<std::size_t>((v * kSize + u) * kLanes + l)];
          }
        }
      }
    }
    return images;
  }

  TiltGeometry geometry(int hand, double axis) const {
    TiltGeometry g = centred_geometry(kSize, kSize, kSize, tilt_deg_);
    g.hand = hand;
    g.axis_x = g.axis_z = axis;
    return g;
  }

  struct Agreement {
    double correlation, sum_ratio;
  };
  Agreement agreement(const Volume& ours, int view) const {
    double n = kSize * kSize, a = 0, b = 0, aa = 0, ab = 0, bb = 0;
    for (std::size_t i = 0; i < kSize * kSize; ++i) {
      const double x = ours[static_cast<std::size_t>(view) * kSize * kSize + i];
      const double y = projections_[static_cast<std::size_t>(view) * kSize * kSize + i];
      a += x;
      b += y;
      aa += x * x;
      ab += x * y;
      bb += y * y;
    }
    return {(n * ab - a * b) / std::sqrt((n * aa - a * a) * (n * bb - b * b)), a / b};
  }

  double worst_correlation(int hand, double axis) const {
    const Volume ours = project_truth(geometry(hand, axis));
    double worst = 1;
    for (std::size_t v = 0; v < tilt_deg_.size(); ++v)
      worst = std::min(worst, agreement(ours, static_cast<int>(v)).correlation);
    return worst;
  }

  Volume truth_, projections_;
  std::vector<double> tilt_deg_;
};

// Their axis runs through voxel and pixel 32, whose centre is at 32.5. Their x is X cos θ − Z sin
// θ.
TEST_F(ProjectorCheck, ReproducesEveryView) {
  const Volume ours = project_truth(geometry(-1, 32.5));
  for (std::size_t v = 0; v < tilt_deg_.size(); ++v) {
    const Agreement a = agreement(ours, static_cast<int>(v));
    EXPECT_GE(a.correlation, 0.999) << "tilt " << tilt_deg_[v];
    EXPECT_NEAR(a.sum_ratio, 1.0, 1e-3) << "tilt " << tilt_deg_[v];
  }
}

TEST_F(ProjectorCheck, NoticesAWrongCentreOrHand) {
  EXPECT_GE(worst_correlation(-1, 32.5), 0.999);
  EXPECT_LE(worst_correlation(-1, 32.0), 0.985);
  EXPECT_LE(worst_correlation(-1, 33.0), 0.985);
  EXPECT_LE(worst_correlation(1, 32.5), 0.9);
}

}  // namespace
}  // namespace tomofield::projection
