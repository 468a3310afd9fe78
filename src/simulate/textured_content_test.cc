#include "simulate/textured_content.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <vector>

#include "base/random.h"
#include "simulate/rasterize.h"
#include "simulate/vesicles.h"

namespace tomofield::simulate {
namespace {

CellOptions textured(std::uint64_t seed) {
  return {.content = Content::kTextured,
          .size_px = 96,
          .thickness_px = 56,
          .is_extended = true,
          .max_tilt_deg = 60.0,
          .seed = seed};
}

TEST(TexturedContent, DensitiesAreAboutBetweenZeroAndOne) {
  for (const std::uint64_t seed : {1u, 2u, 3u}) {
    const base::Volume truth = rasterize(make_cell_phantom(textured(seed)));
    const auto [low, high] = std::minmax_element(truth.data.begin(), truth.data.end());
    EXPECT_GE(*low, -0.1f);
    EXPECT_LE(*high, 1.3f);
    EXPECT_GT(*high, 0.7f);
  }
}

TEST(TexturedContent, HasAllKindsOfBodies) {
  const Phantom phantom = make_cell_phantom(textured(5));
  const auto count = [&](auto holds) {
    return std::count_if(phantom.blobs.begin(), phantom.blobs.end(), holds);
  };
  EXPECT_GT(count([](const Blob& b) { return b.sigma > 8.0; }), 10) << "gradients of the ice";
  EXPECT_GT(count([](const Blob& b) { return b.sigma == 1.4; }), 20) << "spikes";
  EXPECT_GT(count([](const Blob& b) { return b.sigma == 1.3; }), 100) << "filaments";
  EXPECT_GT(count([](const Blob& b) { return b.sigma <= 2.0 && b.peak < 0.0; }), 100) << "grain";
  EXPECT_GT(count([](const Blob& b) { return b.sigma > 2.0 && b.sigma <= 6.0; }), 20)
      << "particles";
  // The two membranes of a vesicle have the same centre and come one after the other.
  const auto& bodies = phantom.bodies;
  const auto second = [](const Ellipsoid& a, const Ellipsoid& b) { return a.center == b.center; };
  EXPECT_NE(std::adjacent_find(bodies.begin(), bodies.end(), second), bodies.end());
}

TEST(TexturedContent, MembranesAreTwoToThreeVoxelsThick) {
  const Phantom phantom = make_cell_phantom(textured(6));
  ASSERT_GT(phantom.bodies.size(), 10u);
  for (const Ellipsoid& e : phantom.bodies) {
    const double thickness = (1.0 - e.ratio) * e.radius;
    EXPECT_GE(0.8 * thickness, 1.9);
    EXPECT_LE(thickness, 3.2);
  }
}

// Returns 0 in the ice, 1 in a wall or between two membranes, 2 in a lumen.
int place_of(const std::vector<Vesicle>& vesicles, const Vector3& p) {
  for (const Vesicle& v : vesicles) {
    const Ellipsoid surface{.center = v.center, .q = v.q};
    const double form = surface.form(p[0] - v.center[0], p[1] - v.center[1], p[2] - v.center[2]);
    if (form < v.lumen_ratio * v.lumen_ratio) return 2;
    if (form < 1.0) return 1;
  }
  return 0;
}

TEST(Vesicles, ClearSpheresTouchNoMembrane) {
  Phantom phantom = make_cell_phantom(textured(7));
  phantom.bodies.clear();
  const auto vesicles = place_vesicles(base::Random(7, 6), phantom);
  base::Random random(1);
  constexpr double kRadius = 4.0;
  int clear_in_ice = 0, clear_in_lumen = 0;
  for (int i = 0; i < 4000; ++i) {
    const Vector3 at = {random.uniform(-48.0, 48.0), random.uniform(-48.0, 48.0),
                        random.uniform(-28.0, 28.0)};
    if (!is_clear_of_membranes(vesicles, at, kRadius)) continue;
    const int place = place_of(vesicles, at);
    ASSERT_NE(place, 1);
    for (int k = 0; k < 20; ++k)
      ASSERT_EQ(place_of(vesicles, moved(at, kRadius, random_direction(random))), place);
    ++(place == 0 ? clear_in_ice : clear_in_lumen);
  }
  EXPECT_GT(clear_in_ice, 400);
  EXPECT_GT(clear_in_lumen, 50);
}

TEST(Vesicles, DoNotTouchEachOther) {
  Phantom phantom = make_cell_phantom(textured(8));
  const auto vesicles = place_vesicles(base::Random(8, 6), phantom);
  ASSERT_GT(vesicles.size(), 10u);
  for (std::size_t i = 0; i < vesicles.size(); ++i) {
    for (std::size_t j = 0; j < i; ++j) {
      const Vesicle &a = vesicles[i], &b = vesicles[j];
      EXPECT_GE(std::hypot(a.center[0] - b.center[0], a.center[1] - b.center[1],
                           a.center[2] - b.center[2]),
                a.radius + b.radius);
    }
  }
}

}  // namespace
}  // namespace tomofield::simulate
