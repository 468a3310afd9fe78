#include "geometry/view_warp.h"

#include <gtest/gtest.h>

#include <cmath>

#include "base/random.h"

namespace tomofield::geometry {
namespace {

// Returns a warp of a view of 60 × 44 pixels whose nodes are fx and fy at their places.
template <typename X, typename Y>
ViewWarp warp_through(const X& fx, const Y& fy) {
  ViewWarp warp{.width_px = 60.0, .height_px = 44.0};
  for (int row = 0; row < 5; ++row) {
    for (int column = 0; column < 5; ++column) {
      const auto [x, y] = warp.node_place(row, column);
      warp.nodes[static_cast<std::size_t>(5 * row + column)] = {fx(x, y), fy(x, y)};
    }
  }
  return warp;
}

ViewWarp random_warp(std::uint64_t seed) {
  base::Random random(seed);
  return warp_through([&](double, double) { return random.normal(); },
                      [&](double, double) { return random.normal(); });
}

TEST(ViewWarp, NodesSpanTheViewAndAreMet) {
  const ViewWarp warp = random_warp(1);
  EXPECT_EQ(warp.node_place(0, 0), (ViewWarp::Vector{-30.0, -22.0}));
  EXPECT_EQ(warp.node_place(3, 2), (ViewWarp::Vector{0.0, 11.0}));
  for (int row = 0; row < 5; ++row) {
    for (int column = 0; column < 5; ++column) {
      const auto [x, y] = warp.node_place(row, column);
      const auto d = warp.displacement(x, y);
      const auto& node = warp.nodes[static_cast<std::size_t>(5 * row + column)];
      EXPECT_NEAR(d[0], node[0], 1e-12);
      EXPECT_NEAR(d[1], node[1], 1e-12);
    }
  }
}

TEST(ViewWarp, LinearFieldsAreExactInTheView) {
  const auto fx = [](double x, double y) { return 0.3 - 0.02 * x + 0.05 * y; };
  const auto fy = [](double x, double y) { return -1.1 + 0.04 * x + 0.01 * y; };
  const ViewWarp warp = warp_through(fx, fy);
  for (double x = -30.0; x <= 30.0; x += 3.7) {
    for (double y = -22.0; y <= 22.0; y += 2.9) {
      EXPECT_NEAR(warp.displacement(x, y)[0], fx(x, y), 1e-12);
      EXPECT_NEAR(warp.displacement(x, y)[1], fy(x, y), 1e-12);
    }
  }
}

TEST(ViewWarp, QuadraticFieldsAreExactAwayFromTheEdge) {
  const auto f = [](double x, double y) { return 0.01 * x * x - 0.02 * x * y + 0.005 * y * y; };
  const ViewWarp warp = warp_through(f, f);
  for (double x = -15.0; x <= 15.0; x += 2.3) {
    for (double y = -11.0; y <= 11.0; y += 1.9)
      EXPECT_NEAR(warp.displacement(x, y)[0], f(x, y), 1e-12);
  }
}

TEST(ViewWarp, SlopesAreContinuousAtTheNodes) {
  const ViewWarp warp = random_warp(2);
  constexpr double kStep = 1e-5;
  for (const double x : {-15.0, 0.0, 15.0}) {
    for (double y = -21.0; y < 22.0; y += 4.0) {
      const double here = warp.displacement(x, y)[0];
      const double left = (here - warp.displacement(x - kStep, y)[0]) / kStep;
      const double right = (warp.displacement(x + kStep, y)[0] - here) / kStep;
      EXPECT_NEAR(left, right, 1e-5);
    }
  }
}

TEST(ViewWarp, OutsideIsTheNearestEdge) {
  const ViewWarp warp = random_warp(3);
  EXPECT_EQ(warp.displacement(45.0, 3.0), warp.displacement(30.0, 3.0));
  EXPECT_EQ(warp.displacement(-99.0, -50.0), warp.displacement(-30.0, -22.0));
}

TEST(ViewWarp, NoComponentExceedsTheLargest) {
  for (std::uint64_t seed = 0; seed < 20; ++seed) {
    // Nodes of either sign and one size make the splines overshoot most.
    ViewWarp warp = random_warp(seed);
    for (auto& node : warp.nodes) {
      for (double& component : node) component = component < 0.0 ? -1.0 : 1.0;
    }
    for (double x = -30.0; x <= 30.0; x += 1.5) {
      for (double y = -22.0; y <= 22.0; y += 1.1) {
        for (const double component : warp.displacement(x, y))
          EXPECT_LE(std::abs(component), warp.largest_component());
      }
    }
  }
}

TEST(ViewWarp, SourcesAreDisplacedToTheirPlaces) {
  const ViewWarp warp = random_warp(4);
  for (double x = -33.0; x <= 33.0; x += 4.1) {
    for (double y = -25.0; y <= 25.0; y += 3.3) {
      const auto q = warp.source_of(x, y);
      const auto d = warp.displacement(q[0], q[1]);
      EXPECT_NEAR(q[0] + d[0], x, 1e-3);
      EXPECT_NEAR(q[1] + d[1], y, 1e-3);
    }
  }
}

TEST(ViewWarp, OneAfterTheOtherIsExactAtTheNodes) {
  const ViewWarp first = random_warp(5), next = random_warp(6), both = first.then(next);
  for (int row = 0; row < 5; ++row) {
    for (int column = 0; column < 5; ++column) {
      const auto [x, y] = both.node_place(row, column);
      const auto once = first.displacement(x, y);
      const auto twice = next.displacement(x + once[0], y + once[1]);
      EXPECT_NEAR(both.displacement(x, y)[0], once[0] + twice[0], 1e-12);
      EXPECT_NEAR(both.displacement(x, y)[1], once[1] + twice[1], 1e-12);
    }
  }
}

TEST(ViewWarp, LargerPixelsShrinkPlacesAndDisplacements) {
  const ViewWarp warp = random_warp(7), binned = warp.binned(4);
  for (const double x : {-30.0, -8.0, 21.0}) {
    EXPECT_NEAR(binned.displacement(x / 4, 2.5)[0], warp.displacement(x, 10.0)[0] / 4, 1e-12);
    EXPECT_NEAR(binned.displacement(x / 4, 2.5)[1], warp.displacement(x, 10.0)[1] / 4, 1e-12);
  }
}

TEST(ViewWarp, WithoutItsRigidPartItHasNone) {
  const ViewWarp::Rigid added{.shift = {3.0, -2.0}, .magnification = 0.02, .rotation = -0.03};
  const ViewWarp rest = random_warp(8).without(random_warp(8).rigid_part());
  const ViewWarp::Rigid none = rest.rigid_part();
  EXPECT_NEAR(none.shift[0], 0.0, 1e-12);
  EXPECT_NEAR(none.magnification, 0.0, 1e-12);
  EXPECT_NEAR(none.rotation, 0.0, 1e-12);
  const ViewWarp::Rigid less = rest.without(added).rigid_part();
  EXPECT_NEAR(less.shift[0], -3.0, 1e-12);
  EXPECT_NEAR(less.shift[1], 2.0, 1e-12);
  EXPECT_NEAR(less.magnification, -0.02, 1e-12);
  EXPECT_NEAR(less.rotation, 0.03, 1e-12);
}

}  // namespace
}  // namespace tomofield::geometry
