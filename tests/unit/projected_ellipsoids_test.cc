// Tests the slab projector against the analytic projections of ellipsoids.

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <string>
#include <vector>

#include "kernels/lanes.h"
#include "projected_slab.h"
#include "simulate/phantom.h"
#include "simulate/project_phantom.h"

namespace tomofield::projection {
namespace {

using geometry::centred_geometry;
using geometry::TiltGeometry;
using kernels::kLanes;
using simulate::Ellipsoid;
using testing::for_each_sample;
using testing::project_slab;

// A scene of bodies in pixels of the view, centred in the 16 rows.
struct Scene {
  TiltGeometry geometry;
  std::vector<Ellipsoid> bodies;  // positions relative to the axis, y to the middle row
};

// Returns the length of [z0, z1] inside an ellipsoid with axes along X, Y, Z at (x, y).
double z_overlap(const Ellipsoid& e, double x, double y, double z0, double z1) {
  const double dx = x - e.center[0], dy = y - e.center[1];
  const double rest = 1 - e.q[0] * dx * dx - e.q[1] * dy * dy;
  if (rest <= 0) return 0;
  const double half = std::sqrt(rest / e.q[2]);
  return std::max(0.0, std::min(z1, e.center[2] + half) - std::max(z0, e.center[2] - half));
}

// Returns the densities averaged over each sample's cell in x and z.
std::vector<float> sample_bodies(const Scene& scene, const SampleGrid& grid) {
  constexpr int kSub = 8;
  std::vector<float> samples(grid.size());
  const TiltGeometry& g = scene.geometry;
  for_each_sample(grid, [&](std::size_t at, const SampleSegment& s, int i, int k, int l) {
    double sum = 0;
    for (const Ellipsoid& e : scene.bodies) {
      for (int sub = 0; sub < kSub; ++sub) {
        const double x = s.x0 + (i + (sub + 0.5) / kSub) * s.hx - g.axis_x;
        sum += e.wall_density * z_overlap(e, x, l + 0.5 - kLanes / 2, k * s.hz - g.axis_z,
                                          (k + 1) * s.hz - g.axis_z);
      }
    }
    samples[at] = static_cast<float>(sum / kSub / s.hz);
  });
  return samples;
}

// Returns the exact integrals [pixel, lane] of a view, averaged over the width of a pixel.
std::vector<double> exact_projection(const Scene& scene, int view) {
  constexpr int kSub = 8;
  const TiltGeometry& g = scene.geometry;
  std::vector<double> rays(static_cast<std::size_t>(g.width * kLanes));
  for (int sub = 0; sub < kSub; ++sub) {
    const simulate::ViewFrame frame{
        .width = g.width,
        .height = kLanes,
        .tilt_deg = g.hand * g.tilt_deg[static_cast<std::size_t>(view)],
        .raw_from_aligned = {.shift_x_px = g.axis_x - static_cast<double>(g.width) / 2 +
                                           (sub + 0.5) / kSub - 0.5}};
    const auto image = project_ellipsoids(scene.bodies, frame);
    for (std::int64_t u = 0; u < g.width; ++u) {
      for (int l = 0; l < kLanes; ++l) {
        rays[static_cast<std::size_t>(u * kLanes + l)] +=
            image[static_cast<std::size_t>(l * g.width + u)] / kSub;
      }
    }
  }
  return rays;
}

struct Errors {
  double worst = 0, rms = 0;  // relative to the largest integral of the view
  double sum = 0;             // relative error of the view's sum
};

Errors errors_of_view(const Scene& scene, int view, const std::vector<float>& detector) {
  const auto expected = exact_projection(scene, view);
  const double largest = *std::max_element(expected.begin(), expected.end());
  double worst = 0, squares = 0, sum = 0, expected_sum = 0;
  for (std::size_t i = 0; i < expected.size(); ++i) {
    const double found = detector[static_cast<std::size_t>(view) * expected.size() + i];
    worst = std::max(worst, std::abs(found - expected[i]));
    squares += (found - expected[i]) * (found - expected[i]);
    sum += found;
    expected_sum += expected[i];
  }
  return {worst / largest, std::sqrt(squares / static_cast<double>(expected.size())) / largest,
          std::abs(sum / expected_sum - 1)};
}

// Errors come from the field's samples, which blur an edge by about one of them. The bounds are the
// measured maxima over all angles and both hands, and a fifth more. A body in the margin is blurred
// by the margin's spacing.
struct EllipsoidCase {
  const char* name;
  double roi_x0, roi_x1, margin_spacing;
  Errors bound;
};

class Ellipsoids : public ::testing::TestWithParam<EllipsoidCase> {};
INSTANTIATE_TEST_SUITE_P(
    Cases, Ellipsoids,
    ::testing::Values(EllipsoidCase{"in_the_region", 0, 97, 0, {0.040, 0.0052, 1.2e-4}},
                      EllipsoidCase{"across_the_faces_spacing_2", 35, 62, 2, {0.134, 0.0164, 8e-4}},
                      EllipsoidCase{"in_the_margin_spacing_2", 80, 97, 2, {0.134, 0.0164, 8e-4}},
                      EllipsoidCase{"across_the_faces_spacing_4", 35, 62, 4, {0.252, 0.041, 8e-4}}),
    [](const auto& c) { return std::string(c.param.name); });

TEST_P(Ellipsoids, ProjectToTheirAnalyticIntegrals) {
  for (const int hand : {1, -1}) {
    TiltGeometry g = centred_geometry(97, kLanes, 61, testing::kProjectorAngles);
    g.hand = hand;
    g.axis_x += 0.75;
    g.axis_z += 1.5;
    const Scene scene{g,
                      {simulate::make_sphere({3.3, 1.0, -2.2}, 20, 1.0),
                       simulate::make_aligned_ellipsoid({-20.4, -2.0, 14.1}, {9, 25, 6}, 0.8)}};
    const EllipsoidCase& c = GetParam();
    const SampleGrid grid = make_sample_grid(g, c.roi_x0, c.roi_x1, c.margin_spacing);
    const auto detector = project_slab(g, grid, sample_bodies(scene, grid));
    for (int v = 0; v < g.num_views(); ++v) {
      SCOPED_TRACE(::testing::Message()
                   << "tilt " << g.tilt_deg[static_cast<std::size_t>(v)] << " hand " << hand);
      const Errors errors = errors_of_view(scene, v, detector);
      EXPECT_LE(errors.worst, c.bound.worst);
      EXPECT_LE(errors.rms, c.bound.rms);
      EXPECT_LE(errors.sum, c.bound.sum);
    }
  }
}

}  // namespace
}  // namespace tomofield::projection
