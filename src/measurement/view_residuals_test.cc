#include "measurement/view_residuals.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <vector>

#include "base/random.h"
#include "kernels/lanes.h"
#include "random_arrays.h"

namespace tomofield::measurement {
namespace {

using kernels::kLanes;
using testing::random_floats;

constexpr std::int64_t kWidth = 19;

// Some rays masked, one pixel wholly, and one wholly counted.
std::vector<std::uint16_t> random_mask() {
  base::Random random(8);
  std::vector<std::uint16_t> mask(kWidth);
  for (auto& m : mask) m = static_cast<std::uint16_t>(random.bits());
  mask[3] = 0;
  mask[4] = 0xffff;
  return mask;
}

bool counts(const std::vector<std::uint16_t>& mask, std::size_t ray) {
  return mask[ray / kLanes] >> (ray % kLanes) & 1u;
}

// ½ w Σ mask h(a p + o − b) in double, with Huber's h(r): r² up to the limit and linear beyond it.
double loss_of(const ViewModel& m, const std::vector<double>& p, const std::vector<float>& b,
               const std::vector<std::uint16_t>& mask) {
  double sum = 0;
  for (std::size_t i = 0; i < p.size(); ++i) {
    if (!counts(mask, i)) continue;
    const double size = std::abs(m.scale * p[i] + m.offset - static_cast<double>(b[i]));
    const double limited = std::min(size, m.largest_residual);
    sum += limited * (2 * size - limited);
  }
  return m.weight / 2 * sum;
}

void expect_derivative_of_the_loss(const ViewModel& model) {
  constexpr double kMultiplicity = 8;
  const auto predicted = random_floats(kWidth * kLanes, 1, -2, 3);
  const auto measured = random_floats(kWidth * kLanes, 2, -2, 3);
  const auto mask = random_mask();
  auto rays = predicted;
  data_term(model, kMultiplicity, measured.data(), mask.data(), kWidth, rays.data());
  auto p = testing::to_double(predicted);
  for (std::size_t i = 0; i < p.size(); ++i) {
    const double kept = p[i];
    p[i] = kept + 1e-4;
    const double up = loss_of(model, p, measured, mask);
    p[i] = kept - 1e-4;
    const double down = loss_of(model, p, measured, mask);
    p[i] = kept;
    ASSERT_NEAR(rays[i], kMultiplicity * (up - down) / 2e-4, 2e-5) << "ray " << i;
    if (!counts(mask, i)) {
      ASSERT_EQ(rays[i], 0.0f) << "masked ray " << i;
    }
  }
}

TEST(DataTerm, GradientIsTheDerivativeOfTheLoss) {
  expect_derivative_of_the_loss({.scale = 1.3, .offset = -0.4, .weight = 2.5});
}

TEST(DataTerm, GradientOfLargeResidualsIsThatOfHubersLoss) {
  expect_derivative_of_the_loss(
      {.scale = 1.3, .offset = -0.4, .weight = 2.5, .largest_residual = 1.0});
}

TEST(DataTerm, ResidualsCountUpToTheirLimit) {
  const std::vector<float> measured(kLanes, 0.0f);
  std::vector<float> rays(kLanes, 0.5f);
  rays[3] = 7.0f;
  rays[5] = -9.0f;
  const std::uint16_t mask = 0xffff;
  const ViewSums sums =
      data_term({.largest_residual = 2.0}, 1.0, measured.data(), &mask, 1, rays.data());
  EXPECT_EQ(rays[3], 2.0f);
  EXPECT_EQ(rays[5], -2.0f);
  EXPECT_EQ(rays[0], 0.5f);
  EXPECT_NEAR(sums.limited_squares, 14 * 0.25 + 2 * 4.0, 1e-6);
  EXPECT_NEAR(sums.squared_residual({}), 14 * 0.25 + 49 + 81, 1e-4);  // the whole, as it was
}

TEST(DataTerm, SumsTellTheLossForAnyScaleAndOffset) {
  const auto predicted = random_floats(kWidth * kLanes, 1, -2, 3);
  const auto measured = random_floats(kWidth * kLanes, 2, -2, 3);
  const auto mask = random_mask();
  auto rays = predicted;
  const ViewSums sums = data_term({}, 1.0, measured.data(), mask.data(), kWidth, rays.data());
  std::int64_t num_counted = 0;
  for (std::size_t i = 0; i < rays.size(); ++i) num_counted += counts(mask, i);
  EXPECT_EQ(sums.n, static_cast<double>(num_counted));
  for (const ViewModel& m : {ViewModel{}, ViewModel{1.7, -3.0, 1.0}, ViewModel{0.2, 5.0, 1.0}}) {
    const double expected = 2 * loss_of(m, testing::to_double(predicted), measured, mask);
    EXPECT_NEAR(sums.squared_residual(m), expected, 1e-5 * expected);
  }
}

TEST(DataTerm, MaskedRaysDoNotCountWhateverTheyHold) {
  const auto mask = random_mask();
  const auto run = [&](float junk) {
    auto rays = random_floats(kWidth * kLanes, 1);
    auto measured = random_floats(kWidth * kLanes, 2);
    for (std::size_t i = 0; i < rays.size(); ++i) {
      if (!counts(mask, i)) measured[i] = junk;
    }
    const ViewSums s = data_term({}, 1.0, measured.data(), mask.data(), kWidth, rays.data());
    return std::pair(rays, std::vector<double>{s.n, s.p, s.b, s.pp, s.pb, s.bb});
  };
  EXPECT_EQ(run(0.0f), run(1e6f));
}

TEST(DataTerm, RayByRayIsTheSame) {
  const ViewModel model{.scale = 1.3, .offset = -0.4, .weight = 2.5, .largest_residual = 1.5};
  const auto predicted = random_floats(kWidth * kLanes, 1, -2, 3);
  const auto measured = random_floats(kWidth * kLanes, 2, -2, 3);
  const auto mask = random_mask();
  auto rays = predicted;
  const ViewSums whole = data_term(model, 8, measured.data(), mask.data(), kWidth, rays.data());
  ViewSums sums;
  for (std::size_t i = 0; i < rays.size(); ++i) {
    if (!counts(mask, i)) continue;
    const double grad = ray_data_term(model, 8, static_cast<double>(measured[i]),
                                      static_cast<double>(predicted[i]), sums);
    ASSERT_NEAR(grad, rays[i], 1e-6 * (10 + std::abs(grad)));
  }
  EXPECT_EQ(sums.n, whole.n);
  EXPECT_NEAR(sums.limited_squares, whole.limited_squares, 1e-5 * whole.limited_squares);
  EXPECT_NEAR(sums.squared_residual(model), whole.squared_residual(model),
              1e-5 * whole.squared_residual(model));
}

TEST(DataTerm, SumsOfPartsAdd) {
  ViewSums total{1, 2, 3, 4, 5, 6, 7};
  total += {10, 20, 30, 40, 50, 60, 70};
  EXPECT_EQ(total.n, 11);
  EXPECT_EQ(total.p, 22);
  EXPECT_EQ(total.b, 33);
  EXPECT_EQ(total.pp, 44);
  EXPECT_EQ(total.pb, 55);
  EXPECT_EQ(total.bb, 66);
  EXPECT_EQ(total.limited_squares, 77);
}

// ------------------------------------------------------------- nuisances

struct Truth {
  std::vector<double> scales, offsets;
};

// Views of random rays p with measured = scale · p + offset, no noise.
std::vector<ViewSums> sums_of_views(const Truth& truth) {
  std::vector<ViewSums> all;
  base::Random random(5);
  for (std::size_t v = 0; v < truth.scales.size(); ++v) {
    ViewSums& s = all.emplace_back();
    for (int i = 0; i < 500; ++i) {
      const double p = random.uniform(2, 6), b = truth.scales[v] * p + truth.offsets[v];
      s += {1, p, b, p * p, p * b, b * b};
    }
  }
  return all;
}

// Scales whose logarithms add up to 0, as the fit leaves them.
Truth balanced_truth() { return {{0.8, 1.25, 1.6, 0.625, 1.0}, {0.3, -0.2, 0.0, 1.5, -0.7}}; }

TEST(Nuisances, AreFoundExactlyUnderWeakPriors) {
  const Truth truth = balanced_truth();
  std::vector<ViewModel> views(5, ViewModel{.scale = 3, .offset = 9, .weight = 4});
  fit_nuisances({.shrinkage = 1e-12}, sums_of_views(truth), views);
  for (std::size_t v = 0; v < views.size(); ++v) {
    EXPECT_NEAR(views[v].scale, truth.scales[v], 1e-9) << v;
    EXPECT_NEAR(views[v].offset, truth.offsets[v], 1e-8) << v;
    EXPECT_EQ(views[v].weight, 4.0);
  }
}

TEST(Nuisances, ScalesKeepTheirGeometricMeanAtOne) {
  Truth truth = balanced_truth();
  for (double& scale : truth.scales) scale *= 1.7;  // the density's business
  for (const double shrinkage : {0.5, 1e-12}) {
    std::vector<ViewModel> views(5);
    fit_nuisances({.shrinkage = shrinkage}, sums_of_views(truth), views);
    double log_scales = 0;
    for (const ViewModel& view : views) log_scales += std::log(view.scale);
    EXPECT_NEAR(log_scales, 0.0, 1e-12) << shrinkage;
  }
  std::vector<ViewModel> views(5);
  fit_nuisances({.shrinkage = 1e-12}, sums_of_views(truth), views);
  for (std::size_t v = 0; v < views.size(); ++v) {
    EXPECT_NEAR(views[v].scale, truth.scales[v] / 1.7, 1e-9);
    EXPECT_NEAR(views[v].offset, truth.offsets[v], 1e-8);
  }
}

TEST(Nuisances, ShrinkTowardsNone) {
  const Truth truth = balanced_truth();
  const auto sums = sums_of_views(truth);
  double last_scale = 1e9, last_offset = 1e9;
  for (const double shrinkage : {0.1, 1.0, 10.0, 1e3, 1e7}) {
    std::vector<ViewModel> views(5, ViewModel{.scale = 1, .offset = 0, .weight = 0.5});
    fit_nuisances({.shrinkage = shrinkage}, sums, views);
    double scale = 0, offset = 0;
    for (const ViewModel& view : views) {
      scale = std::max(scale, std::abs(std::log(view.scale)));
      offset = std::max(offset, std::abs(view.offset));
    }
    EXPECT_LT(offset, last_offset) << shrinkage;
    if (shrinkage > 1) {
      EXPECT_LT(scale, last_scale) << shrinkage;
    }
    last_scale = scale;
    last_offset = offset;
  }
  EXPECT_LT(last_scale, 1e-5);
  EXPECT_LT(last_offset, 1e-5);
}

// The answer minimises w Σ (a p + o − b)² + shrinkage · w (Σ p² (a − 1)² + n o²).
TEST(Nuisances, SolveTheNormalEquationsOfThePrior) {
  const Truth truth{{1.1, 1 / 1.1}, {0.4, -0.6}};
  const auto sums = sums_of_views(truth);
  const NuisancePrior prior{.shrinkage = 0.4};
  // Two equal views: the common scale is that of either, so undo it.
  for (std::size_t v = 0; v < 2; ++v) {
    std::vector<ViewModel> views(1, ViewModel{.scale = 1, .offset = 0, .weight = 0.3});
    fit_nuisances(prior, {sums[v]}, views);
    EXPECT_EQ(views[0].scale, 1.0);  // one view alone has no scale of its own
    const auto objective = [&](double scale, double offset) {
      return 0.3 * sums[v].squared_residual({scale, offset, 1}) +
             0.3 * prior.shrinkage *
                 (sums[v].pp * std::pow(scale - 1, 2) + sums[v].n * std::pow(offset, 2));
    };
    // The best scale for this offset, from the parabola through three points.
    const double o = views[0].offset, h = 0.1;
    const double low = objective(1 - h, o), middle = objective(1, o), high = objective(1 + h, o);
    const double a = 1 - h * (high - low) / (2 * (high - 2 * middle + low));
    for (const double d : {-1e-4, 1e-4}) {
      EXPECT_LT(objective(a, o), objective(a + d, o));
      EXPECT_LT(objective(a, o), objective(a, o + d));
    }
  }
}

// A view may be far brighter than all of its contrast. A prior that shrank its offset would leave a
// share of that to the density.
TEST(Nuisances, FreeOffsetsTakeAllOfTheMeans) {
  Truth truth = balanced_truth();
  for (double& offset : truth.offsets) offset += 1000.0;
  const auto sums = sums_of_views(truth);
  std::vector<ViewModel> views(5);
  fit_nuisances({.has_free_offsets = true}, sums, views);
  for (std::size_t v = 0; v < views.size(); ++v) {
    const ViewSums& s = sums[v];
    EXPECT_NEAR(views[v].scale * s.p + views[v].offset * s.n, s.b, 1e-9 * s.b) << v;
    EXPECT_EQ(views[v].offset, mean_offset(s, views[v]));
    // The scale goes from 1 towards that of the view, as far as the prior lets it.
    EXPECT_GT((views[v].scale - 1.0) * (truth.scales[v] - 1.0), truth.scales[v] == 1.0 ? -1.0 : 0.0)
        << v;
  }
}

TEST(Nuisances, AViewThatShowsNothingKeepsABoundedScale) {
  // A constant prediction or no ray at all: the prior alone decides.
  std::vector<ViewModel> views(2);
  fit_nuisances({}, {ViewSums{}, ViewSums{100, 0, 50, 0, 0, 30}}, views);
  for (const ViewModel& view : views) {
    EXPECT_NEAR(view.scale, 1.0, 1e-12);
    EXPECT_TRUE(std::isfinite(view.offset));
  }
  EXPECT_EQ(views[0].offset, 0.0);
}

}  // namespace
}  // namespace tomofield::measurement
