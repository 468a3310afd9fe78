#include "align/local/local_registration.h"

#include <gtest/gtest.h>

#include <cmath>
#include <vector>

#include "align/registration.h"
#include "base/random.h"
#include "gaussian_scene.h"

namespace tomofield::alignment {
namespace {

using geometry::ViewWarp;

constexpr std::int64_t kWidth = 96, kHeight = 80;
constexpr double kPixel = 2.0;  // of the stage, in pixels of the view

ViewWarp no_motion() { return {.width_px = kPixel * kWidth, .height_px = kPixel * kHeight}; }

// Returns smooth motion with displacements of about a pixel of the view.
ViewWarp smooth_motion() {
  ViewWarp warp = no_motion();
  for (int row = 0; row < ViewWarp::kNodes; ++row)
    for (int column = 0; column < ViewWarp::kNodes; ++column)
      warp.nodes[static_cast<std::size_t>(row * ViewWarp::kNodes + column)] = {
          1.2 * std::sin(0.9 * row + 0.4 * column), 1.0 * std::cos(1.1 * column - 0.3 * row)};
  return warp;
}

// Registers a view whose pixels at q show what is predicted at q + d(q).
LocalRegistration registered(const ViewWarp& motion, double noise, std::uint64_t seed = 1,
                             double prior_px = 4.0) {
  const testing::GaussianScene scene(400, {90, 80, 6});
  const ViewWarp moved = motion.binned(kPixel);
  base::Random random(seed);
  std::vector<float> measured, predicted;
  for (std::int64_t i = 0; i < kWidth * kHeight; ++i) {
    const double x = static_cast<double>(i % kWidth) + 0.5 - kWidth / 2.0;
    const double y = static_cast<double>(i / kWidth) + 0.5 - kHeight / 2.0;
    const auto d = moved.displacement(x, y);
    const auto at = [&](double px, double py) { return scene.projection(px, py, 20.0); };
    predicted.push_back(static_cast<float>(at(x, y)));
    measured.push_back(static_cast<float>(1.3 * at(x + d[0], y + d[1]) + 0.4 + 0.002 * x +
                                          noise * random.normal()));
  }
  LocalRegistration local({.frame = no_motion(),
                           .pixel = kPixel,
                           .prior_px = prior_px,
                           .pixels_per_sample = pixels_per_sample(1.0)});
  const Registration whole({.width = kWidth,
                            .height = kHeight,
                            .pixel = kPixel,
                            .centre_x = kWidth / 2.0,
                            .centre_y = kHeight / 2.0,
                            .measured = measured,
                            .predicted = predicted},
                           {}, &local);
  return local;
}

// Returns the root mean square of the differences over the view, in pixels of the view.
double difference(ViewWarp a, const ViewWarp& b) {
  for (std::size_t node = 0; node < a.nodes.size(); ++node)
    a.nodes[node] = {a.nodes[node][0] - b.nodes[node][0], a.nodes[node][1] - b.nodes[node][1]};
  return std::sqrt(a.mean_square());
}

TEST(LocalRegistration, FindsSmoothMotion) {
  const ViewWarp motion = smooth_motion();
  EXPECT_GT(difference(motion, no_motion()), 1.0);
  EXPECT_LT(difference(registered(motion, 0.02).solve(no_motion()), motion), 0.2);
}

TEST(LocalRegistration, FindsNoneWithoutMotion) {
  EXPECT_LT(difference(registered(no_motion(), 0.02).solve(no_motion()), no_motion()), 0.1);
}

TEST(LocalRegistration, ThePriorHoldsBackWhatIsKnownAlready) {
  // The view agrees with its prediction after `known` is undone.
  const ViewWarp known = smooth_motion();
  const auto left = [&](double prior_px) {
    return difference(known.then(registered(no_motion(), 0.1, 1, prior_px).solve(known)),
                      no_motion()) /
           difference(known, no_motion());
  };
  EXPECT_GT(left(10.0), 0.9);
  EXPECT_LT(left(0.01), 0.3);
}

TEST(LocalRegistration, OnlyMotionBeyondAnAffineOnePays) {
  ViewWarp affine = no_motion();
  for (int row = 0; row < ViewWarp::kNodes; ++row)
    for (int column = 0; column < ViewWarp::kNodes; ++column) {
      const auto [x, y] = affine.node_place(row, column);
      affine.nodes[static_cast<std::size_t>(row * ViewWarp::kNodes + column)] = {0.4 + 0.01 * y,
                                                                                 -0.3 + 0.008 * x};
    }
  EXPECT_LT(registered(affine, 0.1).gain(), 0.05);
  EXPECT_GT(registered(smooth_motion(), 0.1).gain(), 0.3);
}

TEST(LocalRegistration, NoiseIsNotTakenForMotion) {
  std::vector<LocalRegistration> still, moving;
  for (std::uint64_t seed = 1; seed <= 12; ++seed) {
    still.push_back(registered(no_motion(), 0.1, seed));
    moving.push_back(registered(smooth_motion(), 0.1, seed));
  }
  EXPECT_TRUE(motion_that_pays(still).empty());
  EXPECT_EQ(motion_that_pays(moving).size(), moving.size());
}

TEST(LocalRegistration, AViewWithoutPixelsHasNoMotion) {
  const LocalRegistration nothing({.frame = no_motion()});
  EXPECT_EQ(nothing.gain(), 0.0);
  EXPECT_EQ(nothing.solve(no_motion()), no_motion());
}

}  // namespace
}  // namespace tomofield::alignment
