#include "simulate/cryo/bilayer.h"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

namespace tomofield::simulate {
namespace {

VesicleShape vesicle(const Vector3& semi_axes_A) {
  base::Random random(2);
  return {.center_A = {10.0, -20.0, 30.0}, .axes = random_axes(random), .semi_axes_A = semi_axes_A};
}

double area_of(const std::vector<SurfacePoint>& points) {
  double area = 0.0;
  for (const SurfacePoint& p : points) area += p.area_A2;
  return area;
}

TEST(Bilayer, PointsCoverTheSurface) {
  EXPECT_NEAR(area_of(surface_points(vesicle({200, 200, 200}), 11.0)),
              4.0 * std::numbers::pi * 200.0 * 200.0, 1.0);
  // The area of a prolate spheroid.
  const double a = 200.0, c = 300.0, e = std::sqrt(1.0 - a * a / (c * c));
  const double spheroid = 2.0 * std::numbers::pi * a * a * (1.0 + c / (a * e) * std::asin(e));
  EXPECT_NEAR(area_of(surface_points(vesicle({a, a, c}), 11.0)) / spheroid, 1.0, 1e-4);
}

TEST(Bilayer, PointsLieOnTheSurfaceWithTheirNormals) {
  const VesicleShape shape = vesicle({150.0, 200.0, 250.0});
  for (const SurfacePoint& p : surface_points(shape, 40.0)) {
    const Vector3 d = moved(p.position_A, -1.0, shape.center_A);
    double form = 0.0;
    Vector3 gradient{};
    for (std::size_t a = 0; a < 3; ++a) {
      const double along = dot(d, shape.axes[a]) / shape.semi_axes_A[a];
      form += along * along;
      gradient = moved(gradient, along / shape.semi_axes_A[a], shape.axes[a]);
    }
    EXPECT_NEAR(form, 1.0, 1e-9);
    EXPECT_NEAR(dot(normalized(gradient), p.normal), 1.0, 1e-9);
  }
}

TEST(Bilayer, HasTwoSheetsFourNanometresApartAndADip) {
  const auto points = surface_points(vesicle({300, 300, 300}), 11.0);
  std::vector<Gaussian> lipids;
  for (const SurfacePoint& p : points) add_bilayer(p, lipids);
  const Vector3 center = vesicle({300, 300, 300}).center_A;
  const auto potential_along = [&](const Vector3& direction, double height_A) {
    const Vector3 place = moved(center, 300.0 + height_A, direction);
    double sum = 0.0;
    for (const Gaussian& g : lipids) {
      const Vector3 d = moved(g.center_A, -1.0, place);
      sum += g.peak_V() * std::exp(-0.5 * dot(d, d) / (g.sigma_A * g.sigma_A));
    }
    return sum;
  };
  // The density ripples by a few percent between the points, so this takes a mean over directions.
  // Both sheets have as many lipids, which lie closer in the inner one.
  constexpr int kDirections = 16;
  base::Random random(8);
  double across_VA = 0.0;
  for (int i = 0; i < kDirections; ++i) {
    const Vector3 direction = random_direction(random);
    for (double h = -60.0; h < 60.0; h += 4.0)
      across_VA += 4.0 * potential_along(direction, h) / kDirections;
  }
  const double inner = 34.0 * std::pow(300.0 / 280.0, 2), outer = 34.0 * std::pow(300.0 / 320.0, 2);
  EXPECT_NEAR(across_VA, inner + outer + 10.0, 0.015 * 78.0);
  const auto potential = [&](double height_A) {
    return potential_along(points[points.size() / 3].normal, height_A);
  };
  EXPECT_GT(potential(20.0), 2.0 * potential(0.0));
  EXPECT_GT(potential(-20.0), 2.0 * potential(0.0));
  EXPECT_GT(potential(0.0), 0.5);
  EXPECT_LT(potential(45.0), 0.1);
}

}  // namespace
}  // namespace tomofield::simulate
