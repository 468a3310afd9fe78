#include "baseline/classical/wbp.h"

#include <gtest/gtest.h>

#include <cmath>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "base/random.h"
#include "simulate/project_phantom.h"
#include "voxel_comparison.h"

namespace tomofield::baseline {
namespace {

using testing::SphereSeries;

const AfterIteration kNothing = [](const IterationReport&, const VoxelVolume&) {};

// Makes noise-free views, at any tilts, of a ball of density 0.7 off the middle.
struct Ball {
  static constexpr std::int64_t kWidth = 64, kRows = 20;
  static constexpr int kThickness = 32;
  static constexpr double kDensity = 0.7, kRadius = 9, kX = 5, kZ = -3;

  explicit Ball(const std::vector<double>& tilts, double masked_part = 0) {
    geometry = geometry::centred_geometry(kWidth, kRows, kThickness, tilts);
    const std::vector<simulate::Ellipsoid> ball = {
        simulate::make_sphere({kX, 0, kZ}, kRadius, kDensity)};
    rays = std::make_unique<measurement::SlabViews>(
        measurement::SlabViews::Shape{tilts.size(), kWidth, kRows, 0, kRows}, 1.0,
        [&](std::size_t view, std::span<float> image, std::span<std::uint8_t> valid) {
          const auto exact =
              project_ellipsoids(ball, {.width = kWidth, .height = kRows, .tilt_deg = tilts[view]});
          base::Random random(5, view);
          for (std::size_t i = 0; i < image.size(); ++i) {
            valid[i] = random.uniform() >= masked_part;
            image[i] = valid[i] != 0 ? static_cast<float>(exact[i]) : 1e6f;
          }
        },
        "/tmp");
  }

  VoxelVolume reconstructed(const WbpOptions& options, double mean_density = 0) const {
    const VoxelProblem problem(geometry, projection::make_sample_grid(geometry, 0, kWidth, 0),
                               *rays, std::vector<double>(rays->shape().num_views, 0.1));
    return reconstruct_wbp(problem, options, mean_density, kNothing).densities;
  }

  geometry::TiltGeometry geometry;
  std::unique_ptr<measurement::SlabViews> rays;
};

// Returns the mean density in the core of the ball.
double mean_inside(const VoxelVolume& volume) {
  double sum = 0, count = 0;
  testing::for_each_density(volume, [&](int x, int y, int z, float density) {
    const double dx = x + 0.5 - Ball::kWidth / 2.0 - Ball::kX;
    const double dy = y + 0.5 - Ball::kRows / 2.0;
    const double dz = z + 0.5 - Ball::kThickness / 2.0 - Ball::kZ;
    if (std::hypot(dx, dy, dz) > Ball::kRadius - 2) return;
    sum += static_cast<double>(density);
    count += 1;
  });
  return sum / count;
}

std::vector<double> half_circle(double step) {
  std::vector<double> tilts;
  for (double tilt = -90; tilt < 90; tilt += step) tilts.push_back(tilt);
  return tilts;
}

WbpOptions with_window(RampWindow window) {
  WbpOptions options;
  options.filter.window = window;
  return options;
}

class Wbp : public testing::OneThread {};

TEST_F(Wbp, DensitiesAreThoseOfTheBall) {
  const Ball ball(half_circle(3));
  for (const RampWindow window : {RampWindow::kRamp, RampWindow::kCosine, RampWindow::kHann})
    EXPECT_NEAR(mean_inside(ball.reconstructed(with_window(window))), Ball::kDensity, 0.02)
        << base::name_of(window);
}

TEST_F(Wbp, UnevenTiltsCountByTheirSpacing) {
  std::vector<double> tilts;
  for (double tilt = -90; tilt < 0; tilt += 2) tilts.push_back(tilt);
  for (double tilt = 0; tilt < 90; tilt += 5) tilts.push_back(tilt);
  EXPECT_NEAR(mean_inside(Ball(tilts).reconstructed({})), Ball::kDensity, 0.03);
}

TEST_F(Wbp, GapsAreBridged) {
  const VoxelVolume volume = Ball(half_circle(3), 0.1).reconstructed({});
  EXPECT_NEAR(mean_inside(volume), Ball::kDensity, 0.03);
  testing::for_each_density(volume, [](int, int, int, float density) { ASSERT_LT(density, 1.5f); });
}

TEST_F(Wbp, ADensitySetAsideComesBack) {
  // With all tilts the result does not depend on the density that was set aside, but for truncated
  // rays.
  const Ball ball(half_circle(3));
  EXPECT_NEAR(mean_inside(ball.reconstructed({}, 0.1)), mean_inside(ball.reconstructed({})), 0.02);
}

TEST_F(Wbp, FindsTheSpheresInNoiseAndAMissingWedge) {
  const SphereSeries series;
  const VoxelProblem problem = testing::voxel_problem(series);
  const Solution solution = reconstruct_wbp(problem, {}, 0.1, kNothing);
  EXPECT_LT(testing::rms_error(solution.densities), 0.75 * testing::rms_truth());
  ASSERT_EQ(solution.data_loss.size(), 1u);
}

TEST_F(Wbp, ThreadsDoNotChangeABit) {
  const SphereSeries series;
  const VoxelProblem problem = testing::voxel_problem(series);
  base::set_thread_count(1);
  const Solution one = reconstruct_wbp(problem, {}, 0.1, kNothing);
  base::set_thread_count(2);
  const Solution two = reconstruct_wbp(problem, {}, 0.1, kNothing);
  EXPECT_TRUE(testing::same_bits(one.densities, two.densities));
  EXPECT_EQ(one.data_loss, two.data_loss);
}

}  // namespace
}  // namespace tomofield::baseline
