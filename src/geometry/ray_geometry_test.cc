#include "geometry/ray_geometry.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <vector>

#include "base/random.h"

namespace tomofield::geometry {
namespace {

double rad(double degrees) { return degrees * std::numbers::pi / 180.0; }

RayGeometry plain_geometry(std::vector<double> tilts) {
  RayGeometry g;
  g.aligned = centred_geometry(64, 48, 30, tilts);
  g.x_tilt_deg.assign(tilts.size(), 0.0);
  g.raw_from_aligned.assign(tilts.size(), {});
  g.raw_width = 64;
  g.raw_height = 48;
  return g;
}

RawFromAligned rotation(double rot_deg, double shift_x, double shift_y) {
  return {std::cos(rad(rot_deg)),
          -std::sin(rad(rot_deg)),
          std::sin(rad(rot_deg)),
          std::cos(rad(rot_deg)),
          shift_x,
          shift_y};
}

// Returns a geometry with rotations, shifts, x tilts, raw images of another shape, and either hand.
RayGeometry general_geometry(int hand) {
  RayGeometry g = plain_geometry({-60, -20, 0, 35, 70});
  g.aligned.hand = hand;
  g.aligned.axis_x = 30.25;
  g.aligned.axis_z = 12.5;
  g.x_tilt_deg = {3, -2, 5, 0, -7};
  g.raw_from_aligned = {rotation(85, 1.5, -2),
                        rotation(-4, 0, 3),
                        rotation(0, 2.25, 0),
                        rotation(180, -1, 1),
                        {1.02, 0.05, -0.03, 0.97, 0.5, -0.25}};
  g.raw_width = 51;
  g.raw_height = 66;
  return g;
}

TEST(RayGeometry, WithoutAlignmentItIsTheTiltGeometry) {
  for (const int hand : {1, -1}) {
    RayGeometry g = plain_geometry({-70, -45, 0, 26.57, 80});
    g.aligned.hand = hand;
    g.aligned.axis_x = 29.5;
    g.aligned.axis_z = 17;
    for (int v = 0; v < g.num_views(); ++v) {
      const auto uv = g.detector(v, 11.0, 7.5, 21.0);
      EXPECT_NEAR(uv[0], g.aligned.detector_x(v, 11.0, 21.0), 1e-12);
      EXPECT_NEAR(uv[1], 7.5, 1e-12);
      EXPECT_NEAR(g.rays(v).length_per_z, 1 / g.aligned.cos_tilt(v), 1e-12);
    }
  }
}

// Compares with the canonical projection of docs/geometry.md, written out with matrices.
TEST(RayGeometry, IsTheCanonicalProjection) {
  for (const int hand : {1, -1}) {
    RayGeometry g = general_geometry(hand);
    g.aligned.axis_x = 32;  // the aligned view's centre, so that t is the shift alone
    for (int v = 0; v < 4; ++v) {
      const auto at = static_cast<std::size_t>(v);
      const double X = 50 - 32, Y = 10 - 24, Z = hand * (25 - 12.5);
      const double a = rad(g.x_tilt_deg[at]), t = rad(g.aligned.tilt_deg[at]);
      const double rot = std::vector{85.0, -4.0, 0.0, 180.0}[at];
      const double y1 = Y * std::cos(a) - Z * std::sin(a), z1 = Y * std::sin(a) + Z * std::cos(a);
      const double x2 = X * std::cos(t) + z1 * std::sin(t);
      const double u = x2 * std::cos(rad(rot)) - y1 * std::sin(rad(rot));
      const double w = x2 * std::sin(rad(rot)) + y1 * std::cos(rad(rot));
      const auto uv = g.detector(v, 50, 10, 25);
      EXPECT_NEAR(uv[0], 25.5 + u + g.raw_from_aligned[at].shift_x_px, 1e-12);
      EXPECT_NEAR(uv[1], 33.0 + w + g.raw_from_aligned[at].shift_y_px, 1e-12);
    }
  }
}

TEST(RayGeometry, RaysInvertTheProjection) {
  for (const int hand : {1, -1}) {
    const RayGeometry g = general_geometry(hand);
    for (int v = 0; v < g.num_views(); ++v) {
      const RayBundle::Line line = g.rays(v).line(13.5, 40.25);
      for (const double z : {0.0, 11.0, 30.0}) {
        const auto uv = g.detector(v, line.x0 + line.x_per_z * z, line.y0 + line.y_per_z * z, z);
        EXPECT_NEAR(uv[0], 13.5, 1e-10);
        EXPECT_NEAR(uv[1], 40.25, 1e-10);
      }
      EXPECT_NEAR(g.rays(v).length_per_z, std::hypot(1.0, line.x_per_z, line.y_per_z), 1e-12);
    }
  }
}

TEST(RayGeometry, PiecesOfALineAddUpOverATiling) {
  base::Random random(3);
  for (int trial = 0; trial < 200; ++trial) {
    const bool steep = trial % 5 == 0;
    const RayBundle::Line line{random.uniform(-5, 45), random.uniform(-5, 45),
                               steep ? 0.0 : random.uniform(-3, 3), random.uniform(-1, 1)};
    double sum = 0;
    for (int j = 0; j < 4; ++j) {
      for (int i = 0; i < 4; ++i) {
        const HeightRange piece =
            clip(line, {i * 10.0, j * 10.0, i * 10.0 + 10, j * 10.0 + 10}, {0.0, 17.0});
        if (piece.empty()) continue;
        sum += piece.high - piece.low;
        const double z = (piece.low + piece.high) / 2;
        EXPECT_EQ(std::floor((line.x0 + line.x_per_z * z) / 10), i);
        EXPECT_EQ(std::floor((line.y0 + line.y_per_z * z) / 10), j);
      }
    }
    const HeightRange whole = clip(line, {0, 0, 40, 40}, {0.0, 17.0});
    EXPECT_NEAR(sum, whole.empty() ? 0.0 : whole.high - whole.low, 1e-10);
  }
}

// Tests many rays and heights by brute force: no ray that meets the region leaves the rectangle,
// and each side of it is needed.
TEST(RayGeometry, ReachHoldsTheRaysOfTheRegion) {
  const RayGeometry g = general_geometry(1);
  for (const Rectangle& roi : {Rectangle{0, 0, 64, 48}, Rectangle{20, 15, 40, 30}}) {
    const Extent2 reach = reach_of_rays(g, roi);
    Extent2 seen{1e9, 1e9, -1e9, -1e9};
    for (int v = 0; v < g.num_views(); ++v) {
      for (double u = 0; u <= 51; u += 0.5) {
        for (double w = 0; w <= 66; w += 0.5) {
          const RayBundle::Line line = g.rays(v).line(u, w);
          const Extent2 inside{static_cast<double>(roi.x0), static_cast<double>(roi.y0),
                               static_cast<double>(roi.x1), static_cast<double>(roi.y1)};
          if (clip(line, inside, {0, 30}).empty()) continue;
          for (const double z : {0.0, 30.0}) {
            seen.x0 = std::min(seen.x0, line.x0 + line.x_per_z * z);
            seen.x1 = std::max(seen.x1, line.x0 + line.x_per_z * z);
            seen.y0 = std::min(seen.y0, line.y0 + line.y_per_z * z);
            seen.y1 = std::max(seen.y1, line.y0 + line.y_per_z * z);
          }
        }
      }
    }
    EXPECT_LE(reach.x0, seen.x0 + 1e-9);
    EXPECT_LE(reach.y0, seen.y0 + 1e-9);
    EXPECT_GE(reach.x1, seen.x1 - 1e-9);
    EXPECT_GE(reach.y1, seen.y1 - 1e-9);
    // The rectangle is larger than needed only by what the region's corners cost.
    EXPECT_NEAR(reach.x0, seen.x0, 8);
    EXPECT_NEAR(reach.x1, seen.x1, 8);
    EXPECT_NEAR(reach.y0, seen.y0, 8);
    EXPECT_NEAR(reach.y1, seen.y1, 8);
  }
}

}  // namespace
}  // namespace tomofield::geometry
