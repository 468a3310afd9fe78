#include "geometry/tilt_geometry.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <numeric>
#include <utility>

namespace tomofield::geometry {
namespace {
double radians(double degrees) { return degrees * std::numbers::pi / 180.0; }
}  // namespace

double TiltGeometry::cos_tilt(int view) const {
  return std::cos(radians(tilt_deg[static_cast<std::size_t>(view)]));
}

double TiltGeometry::signed_sin_tilt(int view) const {
  return hand * std::sin(radians(tilt_deg[static_cast<std::size_t>(view)]));
}

double TiltGeometry::detector_x(int view, double x, double z) const {
  return axis_x + (x - axis_x) * cos_tilt(view) + (z - axis_z) * signed_sin_tilt(view);
}

double TiltGeometry::ray_x(int view, double u, double z) const {
  return axis_x + (u - axis_x - (z - axis_z) * signed_sin_tilt(view)) / cos_tilt(view);
}

double TiltGeometry::ray_z(int view, double u, double x) const {
  return axis_z + (u - axis_x - (x - axis_x) * cos_tilt(view)) / signed_sin_tilt(view);
}

bool TiltGeometry::is_flat(int view) const {
  return std::abs(tilt_deg[static_cast<std::size_t>(view)]) <= 45.0;
}

TiltGeometry::Extent TiltGeometry::reach() const {
  Extent extent{0.0, static_cast<double>(width)};
  for (int v = 0; v < num_views(); ++v) {
    for (const double u : {0.0, static_cast<double>(width)}) {
      for (const double z : {0.0, thickness}) {
        extent.low = std::min(extent.low, ray_x(v, u, z));
        extent.high = std::max(extent.high, ray_x(v, u, z));
      }
    }
  }
  return extent;
}

TiltGeometry centred_geometry(std::int64_t width, std::int64_t height, double thickness,
                              std::vector<double> tilt_deg) {
  TiltGeometry g;
  g.width = width;
  g.height = height;
  g.thickness = thickness;
  g.tilt_deg = std::move(tilt_deg);
  g.axis_x = static_cast<double>(width) / 2;
  g.axis_z = thickness / 2;
  return g;
}

std::vector<std::size_t> order_of_tilts(std::span<const double> tilt_deg) {
  std::vector<std::size_t> order(tilt_deg.size());
  std::iota(order.begin(), order.end(), std::size_t{0});
  std::ranges::stable_sort(order, {}, [&](std::size_t view) { return tilt_deg[view]; });
  return order;
}

}  // namespace tomofield::geometry
