#include "simulate/phantom.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <vector>

#include "simulate/project_phantom.h"
#include "simulate/rasterize.h"
#include "tomofield/error.h"

namespace tomofield::simulate {
namespace {

CellOptions small_cell(bool is_extended) {
  return {.size_px = 48, .thickness_px = 30, .is_extended = is_extended, .max_tilt_deg = 60.0};
}

/// Returns the midpoint sum of density_at() along one ray, `step` voxels apart.
double quadrature(const Phantom& phantom, const ViewFrame& view, std::int64_t column,
                  std::int64_t row, double step) {
  const double tilt = view.tilt_deg * std::numbers::pi / 180.0;
  const double u = static_cast<double>(column) + 0.5 - static_cast<double>(view.width) / 2.0 -
                   view.raw_from_aligned.shift_x_px;
  const double y = static_cast<double>(row) + 0.5 - static_cast<double>(view.height) / 2.0 -
                   view.raw_from_aligned.shift_y_px;
  double sum = 0.0;
  const double reach = 75.0;
  for (double t = -reach + step / 2.0; t < reach; t += step) {
    sum += density_at(phantom, u * std::cos(tilt) - t * std::sin(tilt), y,
                      u * std::sin(tilt) + t * std::cos(tilt));
  }
  return sum * step;
}

TEST(ProjectPhantom, LineIntegralsMatchQuadrature) {
  for (const bool is_extended : {false, true}) {
    CellOptions options = small_cell(is_extended);
    options.num_beads = 4;
    options.bead_diameter_px = 5.0;
    const Phantom phantom = make_cell_phantom(options);
    ASSERT_GT(phantom.bodies.size(), 20u);
    for (const double tilt_deg : {0.0, -33.3, 45.0, 60.0}) {
      const ViewFrame view{.width = 48,
                           .height = 48,
                           .tilt_deg = tilt_deg,
                           .raw_from_aligned = {.shift_x_px = 2.3, .shift_y_px = -1.4}};
      std::vector<float> image(48 * 48);
      project_view(phantom, view, image);
      for (std::int64_t row = 1; row < 48; row += 9) {
        for (std::int64_t column = 2; column < 48; column += 8) {
          EXPECT_NEAR(image[static_cast<std::size_t>(row * 48 + column)],
                      quadrature(phantom, view, column, row, 0.02), 0.1)
              << tilt_deg << " " << column << " " << row;
        }
      }
    }
  }
}

TEST(ProjectPhantom, SphereHasItsChordsAtItsPlace) {
  const auto sphere = make_sphere({3.25, -2.0, 6.5}, 4.0, 2.5);
  const ViewFrame view{.width = 33, .height = 21, .tilt_deg = 30.0};
  const auto image = project_ellipsoids({&sphere, 1}, view);
  const double center_x = 3.25 * std::cos(std::numbers::pi / 6.0) + 6.5 * 0.5;
  for (int row = 0; row < 21; ++row) {
    for (int column = 0; column < 33; ++column) {
      const double dx = column - 16.0 - center_x, dy = row - 10.0 + 2.0;
      const double expected = 5.0 * std::sqrt(std::max(16.0 - dx * dx - dy * dy, 0.0));
      EXPECT_NEAR(image[static_cast<std::size_t>(row * 33 + column)], expected, 1e-9);
    }
  }
}

TEST(ProjectPhantom, BandsOfRowsGiveTheSameBits) {
  const Phantom phantom = make_cell_phantom(small_cell(true));
  const ViewFrame view{.width = 48, .height = 48, .tilt_deg = -21.0};
  std::vector<float> whole(48 * 48), bands(48 * 48);
  project_view(phantom, view, whole);
  for (std::int64_t row = 0; row < 48; row += 5) {
    const std::int64_t count = std::min<std::int64_t>(5, 48 - row);
    project_rows(phantom, view, row, count,
                 std::span(bands).subspan(static_cast<std::size_t>(row * 48),
                                          static_cast<std::size_t>(count * 48)));
  }
  EXPECT_EQ(whole, bands);
}

TEST(CellPhantom, EllipsoidsKeepTheRecipe) {
  for (const bool is_extended : {false, true}) {
    CellOptions options = small_cell(is_extended);
    const Phantom phantom = make_cell_phantom(options);
    for (std::size_t i = 0; i < phantom.bodies.size(); ++i) {
      const Ellipsoid& e = phantom.bodies[i];
      EXPECT_GE(e.radius, 0.05 * 30.0);
      EXPECT_LE(e.radius, 0.4 * 30.0);
      EXPECT_LE(std::abs(e.center[0]) + e.radius, phantom.half_width_px + 1e-9);
      EXPECT_LE(std::abs(e.center[1]) + e.radius, is_extended ? 24.0 + 2 * e.radius : 24.0 + 1e-9);
      EXPECT_LE(std::abs(e.center[2]) + e.radius, 15.0 + 1e-9);
      // The trace of Q is the sum of 1 / semi-axis², of which one is 1 / radius².
      const double trace = (e.q[0] + e.q[1] + e.q[2]) * e.radius * e.radius;
      EXPECT_GE(trace, 3.0);
      EXPECT_LE(trace, 1.0 + 2.0 / 0.49 + 1e-9);
      for (std::size_t j = 0; j < i; ++j) {
        const Ellipsoid& f = phantom.bodies[j];
        EXPECT_GE(std::hypot(e.center[0] - f.center[0], e.center[1] - f.center[1],
                             e.center[2] - f.center[2]),
                  e.radius + f.radius);
      }
    }
    const base::Volume truth = rasterize(phantom);
    const auto [low, high] = std::minmax_element(truth.data.begin(), truth.data.end());
    EXPECT_FLOAT_EQ(*low, static_cast<float>(0.2 / 1.18));
    EXPECT_LE(*high, 1.0f);
    EXPECT_GT(*high, 0.8f);
  }
}

TEST(CellPhantom, BeadsAreAddedAndTheCellStays) {
  CellOptions options{.size_px = 96, .thickness_px = 40, .seed = 3};
  const Phantom plain = make_cell_phantom(options);
  options.num_beads = 30;
  options.bead_diameter_px = 6.0;
  options.bead_density = 4.0;
  const Phantom beaded = make_cell_phantom(options);
  ASSERT_EQ(beaded.num_beads, 30);
  ASSERT_EQ(beaded.bodies.size(), plain.bodies.size() + 30);
  int on_a_face = 0;
  for (std::size_t i = 0; i < beaded.bodies.size(); ++i) {
    const Ellipsoid& e = beaded.bodies[i];
    if (i < plain.bodies.size()) {
      EXPECT_EQ(e.center, plain.bodies[i].center);
      continue;
    }
    EXPECT_EQ(e.radius, 3.0);
    EXPECT_LE(std::abs(e.center[2]), 17.0);
    on_a_face += std::abs(e.center[2]) == 17.0;
    EXPECT_GE(density_at(beaded, e.center[0], e.center[1], e.center[2]), 4.0 + 0.2 / 1.18 - 1e-12);
  }
  EXPECT_GT(on_a_face, 10);
  EXPECT_LT(on_a_face, 30);
}

TEST(CellPhantom, TooManyBeadsAreRefused) {
  CellOptions options = small_cell(false);
  options.num_beads = 1000;
  options.bead_diameter_px = 10.0;
  EXPECT_THROW(make_cell_phantom(options), Error);
}

TEST(CellPhantom, SeedsDecide) {
  CellOptions options = small_cell(false);
  const Phantom first = make_cell_phantom(options), again = make_cell_phantom(options);
  options.seed = 8;
  const Phantom other = make_cell_phantom(options);
  ASSERT_EQ(first.bodies.size(), again.bodies.size());
  EXPECT_EQ(first.bodies[0].center, again.bodies[0].center);
  EXPECT_NE(first.bodies[0].center, other.bodies[0].center);
}

}  // namespace
}  // namespace tomofield::simulate
