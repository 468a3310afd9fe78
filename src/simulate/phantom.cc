#include "simulate/phantom.h"

#include <fmt/core.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <functional>
#include <numbers>

#include "base/random.h"
#include "simulate/random_ellipsoid.h"
#include "simulate/textured_content.h"
#include "tomofield/error.h"

namespace tomofield::simulate {
namespace {

constexpr double kLargestSum = 1.18;  // slab 0.2 + the densest wall 0.98
constexpr double kSlabDensity = 0.2;
constexpr std::uint64_t kCellStream = 1;
constexpr std::uint64_t kBeadStream = 2;
// The slab counts as full if a bead finds no free place in this number of tries.
constexpr int kTriesPerBead = 1000;

bool touches_any(const std::vector<Ellipsoid>& bodies, std::size_t first, const Vector3& center,
                 double radius) {
  return std::any_of(bodies.begin() + static_cast<std::ptrdiff_t>(first), bodies.end(),
                     [&](const Ellipsoid& e) {
                       const double dx = e.center[0] - center[0];
                       const double dy = e.center[1] - center[1];
                       const double dz = e.center[2] - center[2];
                       const double reach = e.radius + radius;
                       return dx * dx + dy * dy + dz * dz < reach * reach;
                     });
}

// Draws an ellipsoid at the origin whose largest semi-axis is `radius`.
Ellipsoid random_ellipsoid(double radius, base::Random& random) {
  const Vector3 semi_axes = random_semi_axes(0.7 * radius, radius, random);
  const auto axes = random_axes(random);
  Ellipsoid e;
  e.radius = radius;
  e.ratio = random.uniform(0.85, 0.95);
  e.wall_density = random.uniform(0.5, 0.98) / kLargestSum;
  e.inside_density = random.uniform(0.1, 0.5) / kLargestSum;
  e.q = surface_form(axes, semi_axes);
  return e;
}

// Tries one lot of ellipsoids: `num_tries` radii in [low, high), the largest first.
void place_ellipsoids(int num_tries, double low, double high, base::Random& random,
                      Phantom& phantom) {
  std::vector<double> radii(static_cast<std::size_t>(num_tries));
  for (double& r : radii) r = random.uniform(low, high);
  std::sort(radii.begin(), radii.end(), std::greater<>());
  const double half_height = static_cast<double>(phantom.shape.ny) / 2.0;
  const double half_thickness = static_cast<double>(phantom.shape.nz) / 2.0;
  for (const double r : radii) {
    Ellipsoid e = random_ellipsoid(r, random);
    const double x = phantom.half_width_px - r;
    const double y = phantom.is_extended ? half_height + r : half_height - r;
    const double z = half_thickness - r;
    if (x < 0.0 || y < 0.0) continue;  // a thick slab in a small box: it cannot fit
    e.center = {random.uniform(-x, x), random.uniform(-y, y), random.uniform(-z, z)};
    if (!touches_any(phantom.bodies, 0, e.center, r)) phantom.bodies.push_back(e);
  }
}

void place_hollow_ellipsoids(const CellOptions& options, Phantom& phantom) {
  const double thickness = static_cast<double>(options.thickness_px);
  const double half_field = static_cast<double>(options.size_px) / 2.0;
  const double more_tries = options.is_extended ? 1.2 * phantom.half_width_px / half_field : 1.0;
  base::Random random(options.seed, kCellStream);
  place_ellipsoids(static_cast<int>(125 * more_tries), 0.15 * thickness, 0.4 * thickness, random,
                   phantom);
  place_ellipsoids(static_cast<int>(2000 * more_tries), 0.05 * thickness, 0.25 * thickness, random,
                   phantom);
}

}  // namespace

Phantom without_beads(Phantom phantom) {
  phantom.bodies.resize(phantom.bodies.size() - static_cast<std::size_t>(phantom.num_beads));
  phantom.num_beads = 0;
  return phantom;
}

Phantom make_slab(const CellOptions& options) {
  const double size = static_cast<double>(options.size_px);
  const double thickness = static_cast<double>(options.thickness_px);
  const double max_tilt_rad = options.max_tilt_deg * std::numbers::pi / 180.0;
  Phantom phantom;
  phantom.shape = {options.size_px, options.size_px, options.thickness_px};
  phantom.is_extended = options.is_extended;
  phantom.slab_density = kSlabDensity / kLargestSum;
  phantom.half_width_px = size / 2.0;
  if (options.is_extended) {
    phantom.half_width_px =
        size / 2.0 / std::cos(max_tilt_rad) + thickness / 2.0 * std::tan(max_tilt_rad);
  }
  return phantom;
}

void add_beads(const CellOptions& options, Phantom& phantom) {
  base::Random random(options.seed, kBeadStream);
  const double half_field = static_cast<double>(options.size_px) / 2.0;
  const double radius = options.bead_diameter_px / 2.0;
  const double x = phantom.half_width_px - radius;
  const double y = half_field - radius;
  const double z = static_cast<double>(options.thickness_px) / 2.0 - radius;
  const std::size_t first_bead = phantom.bodies.size();
  phantom.num_beads =
      std::llround(static_cast<double>(options.num_beads) * phantom.half_width_px / half_field);
  for (std::int64_t bead = 0; bead < phantom.num_beads; ++bead) {
    Vector3 center;
    int tries = 0;
    do {
      if (++tries > kTriesPerBead)
        throw Error(
            fmt::format("{} gold beads of {} voxels do not fit into the slab without touching each "
                        "other: ask for fewer or smaller ones",
                        options.num_beads, options.bead_diameter_px));
      center = {random.uniform(-x, x), random.uniform(-y, y), 0.0};
      const auto place = random.below(3);
      center[2] = place == 0 ? -z : place == 1 ? z : random.uniform(-z, z);
    } while (touches_any(phantom.bodies, first_bead, center, radius));
    phantom.bodies.push_back(make_sphere(center, radius, options.bead_density));
  }
}

Phantom make_cell_phantom(const CellOptions& options) {
  Phantom phantom = make_slab(options);
  if (options.content == Content::kTextured) {
    add_textured_content(options.seed, phantom);
  } else {
    place_hollow_ellipsoids(options, phantom);
  }
  add_beads(options, phantom);
  return phantom;
}

}  // namespace tomofield::simulate
