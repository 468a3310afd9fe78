#include "projection/ray_projector.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <memory>
#include <string>
#include <vector>

#include "base/enum_names.h"
#include "base/random.h"
#include "base/threads/parallel.h"
#include "central_difference.h"
#include "kernels/lanes.h"
#include "projection/slab_projector.h"
#include "projection/slab_sampler.h"
#include "random_arrays.h"
#include "uneven_model.h"

namespace tomofield::projection {
namespace {

using geometry::Extent2;
using geometry::RayBundle;
using geometry::RayGeometry;

constexpr Extent2 kEverywhere{-1e6, -1e6, 1e6, 1e6};

// Returns the geometry of aligned views without rotation.
RayGeometry plain_geometry(std::int64_t width, std::int64_t height, double thickness,
                           std::vector<double> tilts) {
  RayGeometry g;
  g.aligned = geometry::centred_geometry(width, height, thickness, tilts);
  g.x_tilt_deg.assign(tilts.size(), 0.0);
  g.raw_from_aligned.assign(tilts.size(), {});
  g.raw_width = width;
  g.raw_height = height;
  return g;
}

// Returns a geometry for the uneven model, with rotation, shift and x tilt.
RayGeometry turned_geometry(double thickness) {
  RayGeometry g = plain_geometry(130, 140, thickness, {-60, 0, 40, 75});
  g.x_tilt_deg = {4, -3, 0, 6};
  g.raw_from_aligned[0] = {std::cos(1.4), -std::sin(1.4), std::sin(1.4), std::cos(1.4), 3.5, -2};
  g.raw_from_aligned[3] = {1.01, 0.1, -0.08, 0.99, 0, 7};
  return g;
}

std::vector<Ray> some_rays(const RayGeometry& g, int count, std::uint64_t seed) {
  base::Random random(seed);
  std::vector<Ray> rays;
  for (int i = 0; i < count; ++i) {
    rays.push_back(
        {static_cast<std::int32_t>(random.below(static_cast<std::uint64_t>(g.num_views()))),
         static_cast<std::int32_t>(random.below(static_cast<std::uint64_t>(g.raw_width))),
         static_cast<std::int32_t>(random.below(static_cast<std::uint64_t>(g.raw_height)))});
  }
  return rays;
}

class EachRayField : public ::testing::TestWithParam<FieldKind> {};
INSTANTIATE_TEST_SUITE_P(Kinds, EachRayField, ::testing::Values(FieldKind::kVm, FieldKind::kGrid),
                         [](const auto& kind) { return base::name_of(kind.param); });

// Compares with the leaf that contains each point of a ray, found point by point.
TEST(LeafCrossings, AreWhereTheTreeSaysThatPointsAre) {
  const auto model = testing::uneven_model(FieldKind::kGrid);
  const field::Quadtree& tree = model.field->tree();
  const RayGeometry g = turned_geometry(model.field->thickness());
  for (const Ray& ray : some_rays(g, 300, 5)) {
    const RayBundle::Line line = g.rays(ray.view).line(ray.x + 0.5, ray.y + 0.5);
    std::vector<LeafCrossing> crossings;
    find_crossings(tree, line, {0.0, model.field->thickness()}, crossings);
    double covered = 0;
    for (const LeafCrossing& c : crossings) {
      covered += c.heights.high - c.heights.low;
      for (const double share : {0.01, 0.5, 0.99}) {
        const double z = c.heights.low + share * (c.heights.high - c.heights.low);
        EXPECT_EQ(tree.find_leaf(line.x0 + line.x_per_z * z, line.y0 + line.y_per_z * z), c.leaf);
      }
    }
    constexpr int kPoints = 400;
    int inside = 0;
    for (int i = 0; i < kPoints; ++i) {
      const double z = (i + 0.5) / kPoints * model.field->thickness();
      inside += tree.find_leaf(line.x0 + line.x_per_z * z, line.y0 + line.y_per_z * z) >= 0;
    }
    EXPECT_NEAR(covered / model.field->thickness(), static_cast<double>(inside) / kPoints,
                2.0 / kPoints);
  }
}

// Uses a constant density, for which path lengths are exact for any sampling. Only the rounding of
// floats remains.
TEST(RayProjector, ConstantSlabsHaveTheirPathLengths) {
  constexpr double kThickness = 30;
  const std::vector<double> angles{0, 26.57, 45, 63.43, 70, 71.57, -26.57, -45, -71.57};
  RayGeometry g = plain_geometry(16, 16, kThickness, angles);
  const field::RootGrid roots{.x0 = -160, .y0 = 0, .cell_size = 32, .columns = 11, .rows = 1};
  field::Quadtree tree(roots, std::vector(11, field::Region::kInterest));
  tree.split(5);
  tree.split(4);
  const std::vector<field::LeafShape> shapes(static_cast<std::size_t>(tree.num_leaves()),
                                             {.nx = 4, .ny = 3, .nz = 5});
  const auto field = make_field(FieldKind::kGrid, tree, kThickness, shapes);
  field->bias = 0.7f;
  for (const int samples : {1, 7, 40}) {
    const RayProjector projector(g, *field, kEverywhere, samples);
    std::vector<Ray> rays;
    for (int view = 0; view < g.num_views(); ++view) {
      for (int x = 0; x < 16; ++x) rays.push_back({view, x, 5});
    }
    RayTrace trace;
    const auto predicted = projector.forward(rays, 3, trace);
    for (std::size_t i = 0; i < rays.size(); ++i) {
      const double path = kThickness / g.aligned.cos_tilt(rays[i].view);
      EXPECT_NEAR(predicted[i] / (0.7 * path), 1.0, 2e-6)
          << angles[static_cast<std::size_t>(rays[i].view)] << "°";
    }
  }
}

// Checks path lengths in a box that ends on all sides: its faces must cut the rays.
TEST(RayProjector, SupportCutsRays) {
  constexpr double kThickness = 20;
  const RayGeometry g = plain_geometry(64, 32, kThickness, {0, 63.43, -70});
  const field::Quadtree tree({.x0 = 0, .y0 = 0, .cell_size = 64, .columns = 1, .rows = 1},
                             {field::Region::kInterest});
  const auto field = make_field(FieldKind::kGrid, tree, kThickness, {{.nx = 2, .ny = 2, .nz = 2}});
  field->bias = 1.0f;
  const Extent2 box{10, 4, 50, 30};
  const RayProjector projector(g, *field, box, 10);
  std::vector<Ray> rays;
  for (int view = 0; view < 3; ++view) {
    for (int x = 0; x < 64; ++x) rays.push_back({view, x, x / 2});
  }
  RayTrace trace;
  const auto predicted = projector.forward(rays, 1, trace);
  for (std::size_t i = 0; i < rays.size(); ++i) {
    double path = 0;
    if (rays[i].y >= 4 && rays[i].y < 30) {
      const double at_low = g.aligned.ray_x(rays[i].view, rays[i].x + 0.5, 0.0);
      const double per_z = (g.aligned.ray_x(rays[i].view, rays[i].x + 0.5, 1.0) - at_low);
      double low = 0, high = kThickness;
      if (per_z == 0) {
        if (at_low < 10 || at_low >= 50) high = 0;
      } else {
        const double a = (10 - at_low) / per_z, b = (50 - at_low) / per_z;
        low = std::max(low, std::min(a, b));
        high = std::min(high, std::max(a, b));
      }
      path = std::max(0.0, high - low) * std::hypot(1.0, per_z);
    }
    EXPECT_NEAR(predicted[i], path, 1e-4) << rays[i].view << " " << rays[i].x;
  }
}

// Compares with the field's own density, integrated point by point. With many samples, the
// projector must return the line integral.
TEST_P(EachRayField, ManySamplesGiveTheLineIntegral) {
  const auto model = testing::uneven_model(GetParam());
  const RayGeometry g = turned_geometry(model.field->thickness());
  const auto rays = some_rays(g, 60, 8);
  const RayProjector projector(g, *model.field, kEverywhere, 2000);
  RayTrace trace;
  const auto predicted = projector.forward(rays, 1, trace);
  for (std::size_t i = 0; i < rays.size(); ++i) {
    const RayBundle bundle = g.rays(rays[i].view);
    const RayBundle::Line line = bundle.line(rays[i].x + 0.5, rays[i].y + 0.5);
    constexpr int kSteps = 4000;
    double sum = 0;
    for (int s = 0; s < kSteps; ++s) {
      const double z = (s + 0.5) / kSteps * model.field->thickness();
      sum += model.field->density(line.x0 + line.x_per_z * z, line.y0 + line.y_per_z * z, z);
    }
    sum *= bundle.length_per_z * model.field->thickness() / kSteps;
    EXPECT_NEAR(predicted[i], sum, 2e-3 * (1 + std::abs(sum))) << i;
  }
}

// Checks that draws place the samples differently and that the mean over draws is the integral.
TEST_P(EachRayField, DrawsDifferAndAverageToTheIntegral) {
  const auto model = testing::uneven_model(GetParam());
  const RayGeometry g = turned_geometry(model.field->thickness());
  const auto rays = some_rays(g, 40, 9);
  const RayProjector fine(g, *model.field, kEverywhere, 2000),
      coarse(g, *model.field, kEverywhere, 6);
  RayTrace trace;
  const auto expected = fine.forward(rays, 1, trace);
  const auto once = coarse.forward(rays, 0, trace);
  EXPECT_EQ(once, coarse.forward(rays, 0, trace));
  EXPECT_NE(once, coarse.forward(rays, 1, trace));
  constexpr int kDraws = 100;
  base::set_thread_count(1);  // the pieces of work are tiny
  std::vector<double> mean(rays.size()), square(rays.size());
  for (std::uint32_t draw = 0; draw < kDraws; ++draw) {
    const auto p = coarse.forward(rays, draw, trace);
    for (std::size_t i = 0; i < p.size(); ++i) {
      const double error = static_cast<double>(p[i]) - static_cast<double>(expected[i]);
      mean[i] += error / kDraws;
      square[i] += error * error / kDraws;
    }
  }
  base::set_thread_count(0);
  for (std::size_t i = 0; i < mean.size(); ++i)
    EXPECT_LE(std::abs(mean[i]), 5 * std::sqrt(square[i] / kDraws) + 2e-3 * expected[i]) << i;
}

// Checks ⟨A f, r⟩ = ⟨f, Aᵀ r⟩ for the linear part, without activation and bias. f are the vertices
// of a grid field.
TEST(RayProjector, DotProductsAgree) {
  const auto model = testing::uneven_model(FieldKind::kGrid);
  field::Field& field = *model.field;
  field.activation = {};
  field.bias = 0.0f;
  const RayGeometry g = turned_geometry(field.thickness());
  const auto rays = some_rays(g, 1500, 10);
  const RayProjector projector(g, field, kEverywhere, 25);
  RayTrace trace;
  const auto predicted = projector.forward(rays, 4, trace);
  const auto weights = testing::random_floats(rays.size(), 11);
  std::vector<float> back(field.num_parameters(), 0.0f);
  const double grad_bias = projector.backward(trace, weights, back.data());
  double forward_dot = 0, backward_dot = 0, scale = 0, lengths = 0;
  for (std::size_t i = 0; i < rays.size(); ++i)
    forward_dot += static_cast<double>(predicted[i]) * static_cast<double>(weights[i]);
  for (std::size_t i = 0; i < back.size(); ++i) {
    const double product =
        static_cast<double>(back[i]) * static_cast<double>(field.parameters()[i]);
    backward_dot += product;
    scale += std::abs(product);
  }
  EXPECT_NEAR(forward_dot, backward_dot, 2e-6 * scale);
  EXPECT_GT(std::abs(forward_dot), 1e-3 * scale);
  // A bias of one adds each ray's length.
  field.bias = 1.0f;
  const auto with_bias = projector.forward(rays, 4, trace);
  for (std::size_t i = 0; i < rays.size(); ++i) {
    lengths += (static_cast<double>(with_bias[i]) - static_cast<double>(predicted[i])) *
               static_cast<double>(weights[i]);
  }
  EXPECT_NEAR(grad_bias, lengths, 2e-3 + 1e-5 * std::abs(lengths));
}

TEST_P(EachRayField, BackwardIsTheDerivative) {
  const auto model = testing::uneven_model(GetParam());
  field::Field& field = *model.field;
  const RayGeometry g = turned_geometry(field.thickness());
  const auto rays = some_rays(g, 800, 12);
  const RayProjector projector(g, field, kEverywhere, 20);
  const auto weights = testing::random_floats(rays.size(), 13);
  RayTrace trace;
  projector.forward(rays, 2, trace);
  const auto before = testing::random_floats(field.num_parameters(), 14);
  std::vector<float> gradient = before;
  const double grad_bias = projector.backward(trace, weights, gradient.data());
  const auto objective = [&] {
    RayTrace other;
    const auto predicted = projector.forward(rays, 2, other);
    double sum = 0;
    for (std::size_t i = 0; i < rays.size(); ++i)
      sum += static_cast<double>(predicted[i]) * static_cast<double>(weights[i]);
    return sum;
  };
  const auto derivative = [&](float& p) {
    return testing::central_difference(p, 4e-3f, objective);
  };
  EXPECT_NEAR(grad_bias, derivative(field.bias), 2e-3 * std::abs(grad_bias) + 0.05);
  base::Random random(15);
  int moved = 0;
  for (int n = 0; n < 60; ++n) {
    const int leaf =
        static_cast<int>(random.below(static_cast<std::uint64_t>(field.tree().num_leaves())));
    const std::size_t at =
        field.offset(leaf) + random.below(field.offset(leaf + 1) - field.offset(leaf));
    const double expected = derivative(field.parameters()[at]);
    EXPECT_NEAR(static_cast<double>(gradient[at]) - static_cast<double>(before[at]), expected,
                2e-3 * std::abs(expected) + 0.02)
        << "leaf " << leaf << " parameter " << at;
    moved += std::abs(expected) > 0.5;
  }
  EXPECT_GT(moved, 10) << "derivatives too small to mean anything";
}

TEST_P(EachRayField, SameBitsForAnyNumberOfThreads) {
  const auto model = testing::uneven_model(GetParam());
  const RayGeometry g = turned_geometry(model.field->thickness());
  const auto rays = some_rays(g, 3000, 16);
  const RayProjector projector(g, *model.field, kEverywhere, 15);
  const auto weights = testing::random_floats(rays.size(), 17);
  const auto run = [&](int threads) {
    base::set_thread_count(threads);
    RayTrace trace;
    std::vector<float> result = projector.forward(rays, 5, trace);
    std::vector<float> gradient(model.field->num_parameters(), 0.0f);
    result.push_back(static_cast<float>(projector.backward(trace, weights, gradient.data())));
    base::set_thread_count(0);
    result.insert(result.end(), gradient.begin(), gradient.end());
    return result;
  };
  const auto one = run(1);
  EXPECT_EQ(one, run(2));
  EXPECT_EQ(one, run(5));
}

// Both engines integrate the same field. They differ by the slab engine's sampling, one pixel
// apart, whose error falls with the field's smoothness.
TEST_P(EachRayField, AgreesWithTheSlabEngineAsSamplesGrow) {
  constexpr double kThickness = 24;
  RayGeometry g = plain_geometry(48, 32, kThickness, {-63.43, -26.57, 0, 45, 70});
  const field::RootGrid roots{.x0 = 0, .y0 = 0, .cell_size = 32, .columns = 2, .rows = 1};
  const field::Quadtree tree(roots, {field::Region::kInterest, field::Region::kInterest});
  const std::vector<field::LeafShape> shapes(
      2, {.nx = 5, .ny = 5, .nz = 4, .rank_x = 2, .rank_y = 2, .rank_z = 2});
  const auto field = make_field(GetParam(), tree, kThickness, shapes);
  field->initialise(base::Random(18), 0.5);
  field->bias = 0.5f;
  field->activation = {5.0f};

  const SampleGrid grid = make_sample_grid(g.aligned, 0, 48, 0);
  const SlabProjector slabs(g.aligned, grid);
  const SlabSampler sampler(*field, grid, 0, 32);
  const std::vector<int> views{0, 1, 2, 3, 4};
  std::vector<float> samples(grid.size()), detector(slabs.detector_size(views.size()));
  sampler.decode(1, samples.data());
  slabs.forward(samples.data(), views, detector.data());

  std::vector<Ray> rays;
  std::vector<double> expected;
  for (const int view : views) {
    for (int x = 12; x < 36; ++x) {
      for (int lane = 0; lane < kernels::kLanes; ++lane) {
        rays.push_back({view, x, 16 + lane});
        expected.push_back(
            detector[static_cast<std::size_t>((view * 48 + x) * kernels::kLanes + lane)]);
      }
    }
  }
  // Returns the root mean square difference, relative to the signal.
  const auto difference = [&](int samples_per_diagonal) {
    const RayProjector projector(g, *field, {0, 0, 48, 32}, samples_per_diagonal);
    RayTrace trace;
    const auto predicted = projector.forward(rays, 6, trace);
    double squares = 0, signal = 0;
    for (std::size_t i = 0; i < rays.size(); ++i) {
      squares += std::pow(static_cast<double>(predicted[i]) - expected[i], 2);
      signal += expected[i] * expected[i];
    }
    return std::sqrt(squares / signal);
  };
  const double few = difference(4), some = difference(16), many = difference(64),
               most = difference(512);
  EXPECT_LT(some, 0.5 * few);
  EXPECT_LT(many, 0.7 * some);
  EXPECT_LE(most, many);
  EXPECT_LT(most, 0.015);  // measured 0.012: the error of Joseph's interpolation
}

}  // namespace
}  // namespace tomofield::projection
