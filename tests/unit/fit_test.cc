#include "fit/fit.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <memory>
#include <numeric>
#include <ostream>
#include <span>
#include <string>
#include <vector>

#include "base/enum_names.h"
#include "base/threads/parallel.h"
#include "fit/integer_program.h"
#include "lone_bead_series.h"

namespace tomofield::fit {
namespace {

using testing::Bead;
using testing::BeadSeries;
using testing::small_field;
using testing::tilts;

// Returns the centre of mass of all that is denser than a fifth of the maximum: X, Y, Z in pixels.
std::array<double, 3> center_of_mass(const field::Field& field, const geometry::TiltGeometry& g) {
  const auto nz = static_cast<std::int64_t>(g.thickness);
  std::vector<double> volume;
  for (std::int64_t z = 0; z < nz; ++z) {
    for (std::int64_t y = 0; y < g.height; ++y) {
      for (std::int64_t x = 0; x < g.width; ++x) {
        volume.push_back(field.density(static_cast<double>(x) + 0.5, static_cast<double>(y) + 0.5,
                                       static_cast<double>(z) + 0.5));
      }
    }
  }
  const double floor = 0.2 * *std::max_element(volume.begin(), volume.end());
  double mass = 0;
  std::array<double, 3> sum{};
  std::size_t at = 0;
  for (std::int64_t z = 0; z < nz; ++z) {
    for (std::int64_t y = 0; y < g.height; ++y) {
      for (std::int64_t x = 0; x < g.width; ++x, ++at) {
        const double w = volume[at] > floor ? volume[at] : 0;
        mass += w;
        sum[0] += w * (static_cast<double>(x) + 0.5);
        sum[1] += w * (static_cast<double>(y) + 0.5);
        sum[2] += w * (static_cast<double>(z) + 0.5);
      }
    }
  }
  for (double& s : sum) s /= mass;
  return sum;
}

struct BeadCase {
  const char* name;
  FieldKind field;
  int hand;
  std::int64_t width, height;
  double thickness, axis_x, axis_z;  // the axis relative to the geometric centre
  bool with_margin;
};

void PrintTo(const BeadCase& c, std::ostream* out) { *out << c.name; }

class FindsTheBead : public ::testing::TestWithParam<BeadCase> {};
INSTANTIATE_TEST_SUITE_P(
    Cases, FindsTheBead,
    ::testing::Values(BeadCase{"grid_centred", FieldKind::kGrid, 1, 64, 64, 40, 0, 0, false},
                      BeadCase{"grid_other_hand_odd_off_axis", FieldKind::kGrid, -1, 61, 53, 37,
                               3.3, -2.6, false},
                      BeadCase{"vm_other_hand", FieldKind::kVm, -1, 64, 64, 40, 0, 0, false},
                      BeadCase{"vm_odd_off_axis_margin", FieldKind::kVm, 1, 61, 53, 37, -4.4, 1.5,
                               true}),
    [](const auto& c) { return std::string(c.param.name); });

TEST_P(FindsTheBead, WhereItIs) {
  const BeadCase& c = GetParam();
  geometry::TiltGeometry g =
      geometry::centred_geometry(c.width, c.height, c.thickness, tilts(-60, 60, 3));
  g.hand = c.hand;
  g.axis_x += c.axis_x;
  g.axis_z += c.axis_z;
  const Bead bead({21.3, 35.6, 14.2});
  const BeadSeries series(g, bead, 1);
  FieldOptions options = small_field(c.field);
  options.with_margin = c.with_margin;
  FitOptions fit_options;
  fit_options.coarse_epochs = 5;
  fit_options.epochs = 10;
  Fit fit(series.measurement(), options, fit_options);
  fit.run([](const Fit&) { return true; });
  const auto found = center_of_mass(fit.field(), g);
  // The requirement is 0.2; the fit finds the centre within 0.03.
  for (std::size_t axis = 0; axis < 3; ++axis) {
    EXPECT_NEAR(found[axis], bead.center_of_mass(axis), 0.1) << "axis "
                                                             << "XYZ"[axis];
  }
}

// The parameters, the bias and the losses of a small fit with every term.
struct Outcome {
  std::vector<float> parameters;
  std::vector<double> losses;
};

Outcome small_fit(FieldKind kind, int threads, std::uint64_t seed, int epochs = 3) {
  base::set_thread_count(threads);
  geometry::TiltGeometry g = geometry::centred_geometry(25, 75, 12, tilts(-48, 48, 8));
  const BeadSeries series(g, Bead({11, 30, 5}), 4);
  FieldOptions options = small_field(kind);
  options.leaf_size = 16;  // three bands
  FitOptions fit_options;
  fit_options.epochs = epochs;
  fit_options.subsets = 4;
  fit_options.factor_variation = 0.01;
  fit_options.boundary = 1.0;
  fit_options.fourier = 0.1;
  fit_options.fit_view_scale = true;
  fit_options.seed = seed;
  Fit fit(series.measurement(), options, fit_options);
  fit.run([](const Fit&) { return true; });
  base::set_thread_count(0);
  Outcome outcome{{fit.field().parameters().begin(), fit.field().parameters().end()},
                  fit.progress().data_loss};
  outcome.parameters.push_back(fit.field().bias);
  for (const measurement::ViewModel& view : fit.progress().views) {
    outcome.losses.push_back(view.scale);
    outcome.losses.push_back(view.offset);
  }
  return outcome;
}

class EachFittedField : public ::testing::TestWithParam<FieldKind> {};
INSTANTIATE_TEST_SUITE_P(Kinds, EachFittedField,
                         ::testing::Values(FieldKind::kVm, FieldKind::kGrid),
                         [](const auto& kind) { return base::name_of(kind.param); });

TEST_P(EachFittedField, SameBitsForAnyNumberOfThreads) {
  const Outcome one = small_fit(GetParam(), 1, 5);
  for (const int threads : {2, 3}) {
    const Outcome many = small_fit(GetParam(), threads, 5);
    EXPECT_EQ(one.parameters, many.parameters) << threads;
    EXPECT_EQ(one.losses, many.losses) << threads;
  }
}

// Returns a fit whose tree starts with sixteen leaves of 32 px.
Fit adaptive_fit(const measurement::Measurement& measurement, FieldKind kind, int epochs,
                 int budget) {
  FieldOptions options = small_field(kind);
  options.leaf_size = 32;
  options.vertex_spacing = 4.0;
  options.tree = TreeKind::kAdaptive;
  options.leaf_budget = budget;
  options.with_margin = false;
  FitOptions fit_options;
  fit_options.epochs = epochs;
  fit_options.subsets = 4;
  return Fit(measurement, options, fit_options);
}

int leaves_of_interest(const field::Quadtree& tree) {
  const auto levels = leaves_by_level(tree);
  return static_cast<int>(std::accumulate(levels.begin(), levels.end(), std::int64_t{0}));
}

TEST_P(EachFittedField, AdaptiveTreeFollowsTheDensityWithinItsBudget) {
  if (!can_solve_integer_programs()) GTEST_SKIP() << "this build is without COIN-OR CBC";
  const geometry::TiltGeometry g = geometry::centred_geometry(128, 128, 12, tilts(-48, 48, 8));
  const BeadSeries series(g, Bead({40, 90, 5}), 4);
  const measurement::Measurement measurement = series.measurement();
  const auto run = [&](int threads) {
    base::set_thread_count(threads);
    auto fit = std::make_unique<Fit>(adaptive_fit(measurement, GetParam(), 10, 13));
    fit->run([](const Fit&) { return true; });
    base::set_thread_count(0);
    return fit;
  };
  const auto fit = run(1);
  const field::Quadtree& tree = fit->field().tree();
  EXPECT_LE(leaves_of_interest(tree), 13);
  // The tree is finest at the bead and coarse in the empty corner across from it.
  EXPECT_EQ(tree.leaf(tree.find_leaf(40, 90)).square.size, 16);
  EXPECT_EQ(tree.leaf(tree.find_leaf(100, 20)).square.size, 64);
  for (int i = 0; i < tree.num_leaves(); ++i) EXPECT_EQ(fit->field().shape(i).nx, 9);
  // It started with sixteen leaves, never exceeded its budget, and then stopped changing.
  const TreeProgress& progress = fit->progress().tree;
  ASSERT_GE(progress.updates.size(), 1u);
  EXPECT_EQ(progress.updates[0].epoch, 2);
  EXPECT_TRUE(progress.is_frozen);
  for (const TreeUpdate& u : progress.updates) {
    EXPECT_LE(u.predicted_error, 1.1 * u.error);
    EXPECT_LE(std::accumulate(u.leaves_by_level.begin(), u.leaves_by_level.end(), std::int64_t{0}),
              13);
  }
  const auto& losses = fit->progress().data_loss;
  EXPECT_LT(losses.back(), losses.front());
  const auto same = run(3);
  EXPECT_TRUE(std::ranges::equal(fit->field().parameters(), same->field().parameters()));
}

TEST_P(EachFittedField, SeedDecides) {
  const Outcome one = small_fit(GetParam(), 1, 5);
  EXPECT_EQ(one.parameters, small_fit(GetParam(), 1, 5).parameters);
  EXPECT_NE(one.parameters, small_fit(GetParam(), 1, 6).parameters);
}

TEST_P(EachFittedField, LossFalls) {
  const Outcome outcome = small_fit(GetParam(), 1, 5, 15);
  ASSERT_GE(outcome.losses.size(), 15u);
  EXPECT_LT(outcome.losses[1], outcome.losses[0]);
  EXPECT_LT(outcome.losses[14], 0.5 * outcome.losses[0]);
}

TEST(Fit, EveryEpochUsesEachViewOnce) {
  geometry::TiltGeometry g = geometry::centred_geometry(16, 20, 8, tilts(-48, 48, 8));
  const BeadSeries series(g, Bead({8, 10, 4}), 4);
  FitOptions options;
  options.coarse_epochs = 0;
  options.epochs = 2;
  options.subsets = 5;  // the 13 views form subsets of 3 and 2
  Fit fit(series.measurement(), small_field(FieldKind::kGrid), options);
  EXPECT_EQ(fit.num_steps(), 10);
  int steps = 0;
  fit.run([&](const Fit& f) {
    EXPECT_EQ(f.progress().step, ++steps);
    if (steps % 5 == 4) {
      // All subsets but the last are done, so its rays are missing.
      double rays = 0;
      for (const measurement::ViewSums& s : f.progress().epoch_sums) {
        EXPECT_TRUE(s.n == 0 || s.n == 16 * 20);
        rays += s.n;
      }
      EXPECT_TRUE(rays == 10 * 16 * 20 || rays == 11 * 16 * 20) << rays;
    }
    return true;
  });
  EXPECT_EQ(steps, 10);
  EXPECT_EQ(fit.progress().data_loss.size(), 2u);
}

TEST(Fit, HasNoMoreStepsInAnEpochThanViews) {
  const BeadSeries series(geometry::centred_geometry(16, 20, 8, tilts(-48, 48, 8)),
                          Bead({8, 10, 4}), 4);
  FitOptions options;
  options.subsets = 16;  // of 13 views
  const Fit fit(series.measurement(), small_field(FieldKind::kGrid), options);
  EXPECT_EQ(fit.steps_per_epoch(), 13);
}

TEST(Fit, ViewsThatAreLeftOutTellNothing) {
  const Bead bead({15.3, 20.6, 9.2});
  const auto geometry = geometry::centred_geometry(33, 37, 20, tilts(-60, 60, 12));
  const BeadSeries series(geometry, bead, 3);
  // Another series with the same views but those that are left out.
  const BeadSeries other(geometry, Bead({20.1, 14.2, 11.0}), 3);
  const std::vector<int> views{1, 3, 5, 7, 9};
  const auto fitted = [&](measurement::Measurement measured) {
    measured.left_out = views;
    FitOptions options;
    options.epochs = 3;
    options.subsets = 4;
    Fit fit(measured, small_field(FieldKind::kGrid), options);
    fit.run([](const Fit&) { return true; });
    return std::pair(std::vector(fit.field().parameters().begin(), fit.field().parameters().end()),
                     fit.progress().epoch_sums[3].n);
  };
  measurement::Measurement mixed = series.measurement();
  const auto& from = *series.measurement().rays;
  const auto& left_out = *other.measurement().rays;
  mixed.rays = std::make_shared<measurement::SlabViews>(
      from.shape(), 1.0,
      [&](std::size_t view, std::span<float> image, std::span<std::uint8_t> valid) {
        const auto& source = view % 2 == 1 ? left_out : from;
        for (std::size_t i = 0; i < image.size(); ++i)
          image[i] = source.ray(static_cast<int>(view), static_cast<std::int64_t>(i) % 33,
                                static_cast<std::int64_t>(i) / 33);
        std::ranges::fill(valid, std::uint8_t{1});
      },
      "/tmp");
  EXPECT_EQ(fitted(series.measurement()), fitted(mixed));
}

TEST(Fit, StopsWhenToldAndGoesOnToTheSameBits) {
  geometry::TiltGeometry g = geometry::centred_geometry(16, 20, 8, tilts(-48, 48, 8));
  const BeadSeries series(g, Bead({8, 10, 4}), 4);
  FitOptions options;
  options.coarse_epochs = 2;
  options.epochs = 3;
  const auto parameters = [&](std::int64_t pause_at) {
    Fit fit(series.measurement(), small_field(FieldKind::kVm), options);
    fit.run([&](const Fit& f) { return f.progress().step != pause_at; });
    EXPECT_EQ(fit.progress().step, pause_at > 0 ? pause_at : fit.num_steps());
    fit.run([](const Fit&) { return true; });
    return std::vector<float>(fit.field().parameters().begin(), fit.field().parameters().end());
  };
  EXPECT_EQ(parameters(-1), parameters(11));
}

}  // namespace
}  // namespace tomofield::fit
