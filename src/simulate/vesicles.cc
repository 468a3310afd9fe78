#include "simulate/vesicles.h"

#include <algorithm>
#include <cmath>
#include <functional>
#include <numbers>

namespace tomofield::simulate {
namespace {

constexpr double kSmallestRadius = 8.0;
constexpr double kGapBetweenVesicles = 6.0;  // room for spikes
constexpr double kSmallestDoubleRadius = 16.0;
constexpr double kSmallestSpikedRadius = 12.0;
constexpr double kVoxelsPerGrain = 100.0;

double distance_squared(const Vector3& a, const Vector3& b) {
  const Vector3 offset = moved(a, -1.0, b);
  return dot(offset, offset);
}

Vesicle random_vesicle(double radius, base::Random& random) {
  Vesicle v;
  v.radius = radius;
  v.semi_axes = random_semi_axes(0.8 * radius, radius, random);
  v.axes = random_axes(random);
  v.q = surface_form(v.axes, v.semi_axes);
  return v;
}

// Returns a hollow ellipsoid with the vesicle's outermost surface scaled by `scale`. Its wall is
// `wall_px` thick along the longest semi-axis.
Ellipsoid membrane(const Vesicle& v, double scale, double wall_px) {
  Ellipsoid e{.center = v.center, .q = v.q, .radius = scale * v.radius};
  for (double& entry : e.q) entry /= scale * scale;
  e.ratio = 1.0 - wall_px / e.radius;
  return e;
}

void add_membranes(Vesicle& v, base::Random& random, Phantom& phantom) {
  const double wall_px = random.uniform(2.4, 3.2);
  Ellipsoid outer = membrane(v, 1.0, wall_px);
  outer.wall_density = random.uniform(0.4, 0.7);
  outer.inside_density = random.uniform(0.05, 0.22);
  phantom.bodies.push_back(outer);
  v.lumen_ratio = outer.ratio;
  if (v.radius < kSmallestDoubleRadius || random.uniform() > 0.4) return;

  const double gap_px = random.uniform(4.0, 7.0);
  const double scale = 1.0 - (wall_px + gap_px) / v.radius;
  Ellipsoid inner = membrane(v, scale, wall_px);
  inner.wall_density = random.uniform(0.4, 0.7) - outer.inside_density;
  inner.inside_density = random.uniform(0.05, 0.22) - outer.inside_density;
  phantom.bodies.push_back(inner);
  v.lumen_ratio = scale * inner.ratio;
}

// Places blobs around the outer membrane, at about the same distance from each other: the points of
// a Fibonacci lattice on the unit sphere, mapped to the ellipsoid and moved outwards.
void add_spikes(const Vesicle& v, base::Random& random, Phantom& phantom) {
  constexpr double kHeight = 2.5, kSigma = 1.4;
  const double golden_angle = std::numbers::pi * (3.0 - std::sqrt(5.0));
  const double spacing = random.uniform(7.0, 10.0);
  const double peak = random.uniform(0.3, 0.45);
  const double area = 4.0 * std::numbers::pi * std::pow(0.9 * v.radius, 2);
  const auto count = static_cast<int>(area / (spacing * spacing));
  for (int i = 0; i < count; ++i) {
    const double z = 1.0 - (2.0 * i + 1.0) / count;
    const double r = std::sqrt(1.0 - z * z);
    const Vector3 unit = {r * std::cos(golden_angle * i), r * std::sin(golden_angle * i), z};
    Vector3 normal{};
    for (std::size_t k = 0; k < 3; ++k) normal = moved(normal, unit[k] / v.semi_axes[k], v.axes[k]);
    phantom.blobs.push_back({.center = moved(v.point(unit), kHeight, normalized(normal)),
                             .sigma = kSigma,
                             .peak = peak});
  }
}

void add_grain(const Vesicle& v, base::Random& random, Phantom& phantom) {
  const double amplitude = random.uniform(0.05, 0.11);
  const double volume = 4.0 / 3.0 * std::numbers::pi * std::pow(v.lumen_ratio, 3) * v.semi_axes[0] *
                        v.semi_axes[1] * v.semi_axes[2];
  const auto count = static_cast<int>(volume / kVoxelsPerGrain);
  for (int i = 0; i < count; ++i) {
    const Vector3 direction = random_direction(random);
    const double distance = v.lumen_ratio * std::cbrt(random.uniform());
    const double sigma = random.uniform(1.0, 2.0);
    const double peak = random.below(2) == 0 ? amplitude : -amplitude;
    phantom.blobs.push_back(
        {.center = v.point(moved({}, distance, direction)), .sigma = sigma, .peak = peak});
  }
}

// Tries `num_tries` vesicles with radii in [low, high), the largest first.
void place_lot(int num_tries, double low, double high, base::Random& random, const Phantom& phantom,
               std::vector<Vesicle>& vesicles) {
  std::vector<double> radii(static_cast<std::size_t>(num_tries));
  for (double& r : radii) r = std::max(random.uniform(low, high), kSmallestRadius);
  std::sort(radii.begin(), radii.end(), std::greater<>());
  for (const double r : radii) {
    Vesicle v = random_vesicle(r, random);
    const double x = phantom.half_width_px - r;
    const double y = static_cast<double>(phantom.shape.ny) / 2.0 + r;
    const double z = static_cast<double>(phantom.shape.nz) / 2.0 - r - kGapBetweenVesicles;
    if (z < 0.0) continue;  // the slab is thin
    v.center = {random.uniform(-x, x), random.uniform(-y, y), random.uniform(-z, z)};
    const bool touches = std::any_of(vesicles.begin(), vesicles.end(), [&](const Vesicle& other) {
      const double reach = r + other.radius + kGapBetweenVesicles;
      return distance_squared(v.center, other.center) < reach * reach;
    });
    if (!touches) vesicles.push_back(v);
  }
}

}  // namespace

Vector3 Vesicle::point(const Vector3& in_unit_sphere) const {
  Vector3 p = center;
  for (std::size_t i = 0; i < 3; ++i) p = moved(p, semi_axes[i] * in_unit_sphere[i], axes[i]);
  return p;
}

std::vector<Vesicle> place_vesicles(base::Random random, Phantom& phantom) {
  const double thickness = static_cast<double>(phantom.shape.nz);
  const double area = 2.0 * phantom.half_width_px * static_cast<double>(phantom.shape.ny);
  const auto tries = static_cast<int>(12.0 * area / (thickness * thickness));
  std::vector<Vesicle> vesicles;
  place_lot(tries, 0.12 * thickness, 0.34 * thickness, random, phantom, vesicles);
  place_lot(tries, 0.06 * thickness, 0.14 * thickness, random, phantom, vesicles);
  for (Vesicle& v : vesicles) {
    add_membranes(v, random, phantom);
    if (v.radius >= kSmallestSpikedRadius && random.uniform() < 0.5) add_spikes(v, random, phantom);
    add_grain(v, random, phantom);
  }
  return vesicles;
}

bool is_clear_of_membranes(const std::vector<Vesicle>& vesicles, const Vector3& position,
                           double radius) {
  for (const Vesicle& v : vesicles) {
    const double reach = v.radius + radius;
    if (distance_squared(position, v.center) > reach * reach) continue;
    const Ellipsoid outer{.center = v.center, .q = v.q};
    const Vector3 p = moved(position, -1.0, v.center);
    const double scale = std::sqrt(outer.form(p[0], p[1], p[2]));  // 1 on the outermost surface
    const double margin = radius / std::min({v.semi_axes[0], v.semi_axes[1], v.semi_axes[2]});
    if (scale < v.lumen_ratio - margin) return true;
    if (scale < 1.0 + margin) return false;
  }
  return true;
}

}  // namespace tomofield::simulate
