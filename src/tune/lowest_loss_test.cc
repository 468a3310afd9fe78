#include "tune/lowest_loss.h"

#include <gtest/gtest.h>

#include <cmath>
#include <vector>

#include "base/random.h"

namespace tomofield::tune {
namespace {

constexpr UsualCurvature kUsual{.loss_a_step = 0.016, .deviation = 0.016};

// Losses at whole steps of a parabola that is lowest at `place`, each with an error of its own.
std::vector<LossAt> parabola(double place, double curvature, int first, int last,
                             double standard_error, base::Random* random = nullptr) {
  std::vector<LossAt> losses;
  for (int x = first; x <= last; ++x) {
    const double chance = random ? standard_error * random->normal() : 0.0;
    losses.push_back({.place = static_cast<double>(x),
                      .loss = curvature * std::pow(x - place, 2) + chance,
                      .standard_error = standard_error});
  }
  return losses;
}

// The place where the parabola through the best loss and its neighbours is lowest.
double lowest_of_three(const std::vector<LossAt>& losses) {
  std::size_t best = 0;
  for (std::size_t i = 0; i < losses.size(); ++i)
    if (losses[i].loss < losses[best].loss) best = i;
  if (best == 0 || best + 1 == losses.size()) return losses[best].place;
  const double below = losses[best - 1].loss, here = losses[best].loss,
               above = losses[best + 1].loss;
  return losses[best].place + (below - above) / (2 * (below - 2 * here + above));
}

TEST(LowestLoss, IsThatOfAParabola) {
  for (const double place : {-1.6, -0.5, 0.0, 0.3, 0.9})
    for (const double curvature : {0.008, 0.016, 0.1})
      EXPECT_NEAR(lowest_loss(parabola(place, curvature, -3, 2, 1e-4), kUsual), place, 0.15)
          << place << " " << curvature;
}

TEST(LowestLoss, StaysWithinThePlacesThatWereTried) {
  EXPECT_EQ(lowest_loss(parabola(5, 0.016, -1, 1, 1e-4), kUsual), 1);
  EXPECT_EQ(lowest_loss(parabola(-5, 0.016, -1, 1, 1e-4), kUsual), -1);
  EXPECT_EQ(lowest_loss(std::vector<LossAt>{{.place = 2}}, kUsual), 2);
}

TEST(LowestLoss, ScattersLessThanThatOfThreeLosses) {
  double of_all = 0, of_three = 0;
  for (int seed = 1; seed <= 100; ++seed) {
    base::Random random(static_cast<std::uint64_t>(seed));
    const auto losses = parabola(-0.4, 0.016, -2, 1, 0.008, &random);
    of_all += std::pow(lowest_loss(losses, kUsual) + 0.4, 2);
    of_three += std::pow(lowest_of_three(losses) + 0.4, 2);
  }
  EXPECT_LT(of_all, 0.7 * of_three);
}

TEST(LowestLoss, CountsAnUncertainLossLess) {
  std::vector<LossAt> losses = parabola(0, 0.016, -2, 2, 1e-3);
  losses[1].loss = -0.02;  // which would be the best place by far
  const double sure = lowest_loss(losses, kUsual);
  losses[1].standard_error = 0.05;
  EXPECT_LT(sure, -0.3);
  EXPECT_GT(lowest_loss(losses, kUsual), sure + 0.2);
}

}  // namespace
}  // namespace tomofield::tune
