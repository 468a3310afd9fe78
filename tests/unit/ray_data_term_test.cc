#include "objective/ray_data_term.h"

#include <gtest/gtest.h>

#include <cmath>
#include <map>
#include <set>
#include <tuple>
#include <vector>

#include "base/random.h"
#include "base/threads/parallel.h"
#include "central_difference.h"
#include "fit/fit.h"
#include "random_arrays.h"
#include "sphere_series.h"
#include "tomofield/options.h"

namespace tomofield::fit {
namespace {

using projection::Ray;
using testing::SphereSeries;

// Returns the geometry of the aligned views as if they were recorded so, with a small x tilt.
geometry::RayGeometry ray_geometry(const SphereSeries& series) {
  geometry::RayGeometry g;
  g.aligned = series.geometry;
  g.raw_width = series.geometry.width;
  g.raw_height = series.geometry.height;
  for (int v = 0; v < g.num_views(); ++v) g.x_tilt_deg.push_back(0.04 * v - 0.6);
  g.raw_from_aligned.resize(g.x_tilt_deg.size());
  return g;
}

struct SphereTerm {
  explicit SphereTerm(const FitOptions& fit_options, const Rectangle& roi = {0, 0, 32, 21})
      : options(fit_options),
        geometry(ray_geometry(series)),
        domain(make_domain(geometry, roi, field_options())),
        field(make_initial_field(domain, SphereSeries::kThickness, 0.3, field_options(), 3)),
        term(geometry, *series.rays, *field, objective::RayRegion{domain.roi, domain.support},
             options) {}
  static FieldOptions field_options() {
    FieldOptions o;
    o.kind = FieldKind::kGrid;
    o.leaf_size = 16;
    o.vertex_spacing = 4;
    return o;
  }
  FitOptions options;
  SphereSeries series;
  geometry::RayGeometry geometry;
  Domain domain;
  std::unique_ptr<field::Field> field;
  objective::RayDataTerm term;
};

using Key = std::tuple<int, int, int>;
std::vector<Key> rays_of_epoch(const SphereTerm& s, int epoch) {
  std::vector<Key> keys;
  for (int turn = 0; turn < s.term.steps_per_epoch(); ++turn) {
    for (const Ray& r : s.term.batch(epoch * s.term.steps_per_epoch() + turn))
      keys.emplace_back(r.view, r.x, r.y);
  }
  return keys;
}

TEST(RayDataTerm, AnEpochUsesEachRayOnceInRandomBatches) {
  FitOptions options;
  for (const int subsets : {1, 7, 16, 40}) {
    options.subsets = subsets;
    const SphereTerm s(options);
    ASSERT_EQ(s.term.steps_per_epoch(), subsets);
    const auto first = rays_of_epoch(s, 0), second = rays_of_epoch(s, 1);
    const std::set<Key> all(first.begin(), first.end());
    EXPECT_EQ(all.size(), first.size()) << "a ray came twice";
    EXPECT_EQ(all, std::set<Key>(second.begin(), second.end()));
    std::size_t expected = 0;
    for (int v = 0; v < s.geometry.num_views(); ++v) expected += s.series.rays->num_valid(v);
    EXPECT_EQ(all.size(), expected) << "all rays meet this region";
    if (subsets > 1) {
      EXPECT_NE(s.term.batch(0), s.term.batch(subsets));
    }
    // Every step has its part of every view.
    std::map<int, int> of_view;
    for (const Ray& r : s.term.batch(subsets - 1)) ++of_view[r.view];
    EXPECT_EQ(of_view.size(), static_cast<std::size_t>(s.geometry.num_views()));
    for (const auto& [view, count] : of_view)
      EXPECT_NEAR(count, 0.97 * 32 * 21 / subsets, 0.35 * 32 * 21 / subsets + 3) << view;
  }
}

TEST(RayDataTerm, RaysThatMissTheRegionAreLeftOut) {
  FitOptions options;
  options.subsets = 3;
  const Rectangle roi{10, 6, 20, 14};
  const SphereTerm s(options, roi);
  const auto keys = rays_of_epoch(s, 0);
  const std::set<Key> used(keys.begin(), keys.end());
  for (int v = 0; v < s.geometry.num_views(); ++v) {
    for (int y = 0; y < 21; ++y) {
      for (int x = 0; x < 32; ++x) {
        if (!s.series.rays->counts(v, x, y)) continue;
        const auto line = s.geometry.rays(v).line(x + 0.5, y + 0.5);
        bool meets = false, nearly = false;
        for (double z = 0; z <= SphereSeries::kThickness; z += 0.05) {
          const double X = line.x0 + line.x_per_z * z, Y = line.y0 + line.y_per_z * z;
          meets = meets || (X > 10 && X < 20 && Y > 6 && Y < 14);
          nearly = nearly || (X > 9.8 && X < 20.2 && Y > 5.8 && Y < 14.2);
        }
        if (meets) {
          EXPECT_TRUE(used.contains({v, x, y}));
        }
        if (!nearly) {
          EXPECT_FALSE(used.contains({v, x, y}));
        }
      }
    }
  }
}

// The loss is ½ Σ weight (scale p + offset − b)² over a step's rays, times the steps of an epoch.
TEST(RayDataTerm, GradientIsTheDerivativeOfTheLoss) {
  FitOptions options;
  options.subsets = 5;
  options.ray_samples = 20;
  SphereTerm s(options);
  std::vector<measurement::ViewModel> models;
  for (int v = 0; v < s.geometry.num_views(); ++v)
    models.push_back({1.0 + 0.01 * v, 0.02 * v, 2.0 - 0.03 * v});
  constexpr int kStep = 7;
  const auto loss = [&] {
    std::vector<float> unused(s.field->num_parameters(), 0.0f);
    std::vector<measurement::ViewSums> sums(models.size());
    s.term.add_field({.number = kStep, .views = {}, .models = models}, unused.data(), sums);
    double sum = 0;
    for (std::size_t v = 0; v < models.size(); ++v)
      sum += 0.5 * 5 * models[v].weight * sums[v].squared_residual(models[v]);
    return sum;
  };
  std::vector<float> gradient(s.field->num_parameters(), 0.0f);
  std::vector<measurement::ViewSums> sums(models.size());
  const objective::TermValue result =
      s.term.add_field({.number = kStep, .views = {}, .models = models}, gradient.data(), sums);
  const auto derivative = [&](float& p) { return testing::central_difference(p, 4e-3f, loss); };
  base::set_thread_count(1);  // the work is too small for several
  EXPECT_NEAR(result.grad_bias / derivative(s.field->bias), 1.0, 1e-3);
  base::Random random(4);
  int moved = 0;
  for (int n = 0; n < 25; ++n) {
    const std::size_t at = random.below(gradient.size());
    const double expected = derivative(s.field->parameters()[at]);
    EXPECT_NEAR(gradient[at], expected, 5e-3 * std::abs(expected) + 0.5) << at;
    moved += std::abs(expected) > 50;
  }
  base::set_thread_count(0);
  EXPECT_GT(moved, 5) << "derivatives too small to mean anything";
}

}  // namespace
}  // namespace tomofield::fit
