#include "simulate/cryo/bilayer.h"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace tomofield::simulate {

std::vector<SurfacePoint> surface_points(const VesicleShape& shape, double spacing_A) {
  const Vector3& radii = shape.semi_axes_A;
  const double longest = *std::ranges::max_element(radii);
  const auto count = static_cast<std::int64_t>(
      std::ceil(4.0 * std::numbers::pi * longest * longest / (spacing_A * spacing_A)));
  const double solid_angle = 4.0 * std::numbers::pi / static_cast<double>(count);
  std::vector<SurfacePoint> points(static_cast<std::size_t>(count));
  for (std::int64_t i = 0; i < count; ++i) {
    // Fibonacci's lattice covers the unit sphere evenly.
    const double z = 1.0 - (2.0 * static_cast<double>(i) + 1.0) / static_cast<double>(count);
    const double angle = static_cast<double>(i) * std::numbers::pi * (3.0 - std::sqrt(5.0));
    const double ring = std::sqrt(1.0 - z * z);
    const Vector3 u{ring * std::cos(angle), ring * std::sin(angle), z};
    SurfacePoint& point = points[static_cast<std::size_t>(i)];
    point.position_A = shape.center_A;
    for (std::size_t a = 0; a < 3; ++a) {
      point.position_A = moved(point.position_A, radii[a] * u[a], shape.axes[a]);
      point.normal = moved(point.normal, u[a] / radii[a], shape.axes[a]);
    }
    // The map u → radii u stretches areas by det · |radii⁻¹ u|.
    point.area_A2 =
        solid_angle * radii[0] * radii[1] * radii[2] * std::sqrt(dot(point.normal, point.normal));
    point.normal = normalized(point.normal);
  }
  return points;
}

void add_bilayer(const SurfacePoint& point, std::vector<Gaussian>& gaussians) {
  constexpr double kSigma_A = 5.5;
  constexpr double kHeads_VA = 34.0;
  constexpr double kTails_VA = 10.0;
  const auto add = [&](double height_A, double per_area_VA) {
    gaussians.push_back(
        {moved(point.position_A, height_A, point.normal), kSigma_A, per_area_VA * point.area_A2});
  };
  add(-kHalfBilayer_A, kHeads_VA);
  add(0.0, kTails_VA);
  add(kHalfBilayer_A, kHeads_VA);
}

}  // namespace tomofield::simulate
