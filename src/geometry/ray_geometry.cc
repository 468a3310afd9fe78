#include "geometry/ray_geometry.h"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace tomofield::geometry {
namespace {

// The affine map (u, v) = linear · (X, Y, Z) + constant.
struct Projection {
  std::array<double, 3> u{}, v{};
  double u0 = 0, v0 = 0;
};

// Returns the map of a view. Its linear part is M times rows x and y of Ry(θ) Rx(α) diag(1, 1,
// hand).
Projection projection(const RayGeometry& g, int view) {
  const auto at = static_cast<std::size_t>(view);
  const double alpha = g.x_tilt_deg[at] * std::numbers::pi / 180.0;
  const double theta = g.aligned.tilt_deg[at] * std::numbers::pi / 180.0;
  const double ca = std::cos(alpha), sa = std::sin(alpha);
  const double ct = std::cos(theta), st = std::sin(theta);
  const double hand = g.aligned.hand;
  const std::array<double, 3> qx{ct, st * sa, hand * st * ca};
  const std::array<double, 3> qy{0.0, ca, -hand * sa};
  const std::array<double, 3> centre{g.aligned.axis_x, static_cast<double>(g.aligned.height) / 2,
                                     g.aligned.axis_z};
  // C − c, from the aligned view's centre to the axis, has no y component.
  const double axis = g.aligned.axis_x - static_cast<double>(g.aligned.width) / 2;
  const RawFromAligned& m = g.raw_from_aligned[at];
  Projection p;
  p.u0 = static_cast<double>(g.raw_width) / 2 + m.shift_x_px + m.m11 * axis;
  p.v0 = static_cast<double>(g.raw_height) / 2 + m.shift_y_px + m.m21 * axis;
  for (std::size_t a = 0; a < 3; ++a) {
    p.u[a] = m.m11 * qx[a] + m.m12 * qy[a];
    p.v[a] = m.m21 * qx[a] + m.m22 * qy[a];
    p.u0 -= p.u[a] * centre[a];
    p.v0 -= p.v[a] * centre[a];
  }
  return p;
}

void narrow(double start, double slope, double low, double high, HeightRange& range) {
  if (slope == 0.0) {
    if (!(start >= low && start < high)) range.high = range.low;
    return;
  }
  const double a = (low - start) / slope, b = (high - start) / slope;
  range.low = std::max(range.low, std::min(a, b));
  range.high = std::min(range.high, std::max(a, b));
}

}  // namespace

std::array<double, 2> RayGeometry::detector(int view, double x, double y, double z) const {
  const Projection p = projection(*this, view);
  return {p.u0 + p.u[0] * x + p.u[1] * y + p.u[2] * z, p.v0 + p.v[0] * x + p.v[1] * y + p.v[2] * z};
}

RayBundle RayGeometry::rays(int view) const {
  // The inverse of the first two columns gives (X, Y) from (u, v) and Z.
  const Projection p = projection(*this, view);
  const double determinant = p.u[0] * p.v[1] - p.u[1] * p.v[0];
  const double xu = p.v[1] / determinant, xv = -p.u[1] / determinant;
  const double yu = -p.v[0] / determinant, yv = p.u[0] / determinant;
  RayBundle bundle;
  bundle.x = {-(xu * p.u0 + xv * p.v0), xu, xv, -(xu * p.u[2] + xv * p.v[2])};
  bundle.y = {-(yu * p.u0 + yv * p.v0), yu, yv, -(yu * p.u[2] + yv * p.v[2])};
  bundle.length_per_z = std::hypot(1.0, bundle.x[3], bundle.y[3]);
  return bundle;
}

HeightRange clip(const RayBundle::Line& line, const Extent2& rectangle, const HeightRange& range) {
  HeightRange clipped = range;
  narrow(line.x0, line.x_per_z, rectangle.x0, rectangle.x1, clipped);
  narrow(line.y0, line.y_per_z, rectangle.y0, rectangle.y1, clipped);
  return clipped;
}

Extent2 reach_of_rays(const RayGeometry& geometry, const Rectangle& roi) {
  const Extent2 inside{static_cast<double>(roi.x0), static_cast<double>(roi.y0),
                       static_cast<double>(roi.x1), static_cast<double>(roi.y1)};
  const double thickness = geometry.aligned.thickness;
  Extent2 reach = inside;
  for (int view = 0; view < geometry.num_views(); ++view) {
    const RayBundle rays = geometry.rays(view);
    const double dx = std::abs(rays.x[3]) * thickness, dy = std::abs(rays.y[3]) * thickness;
    Extent2 image{inside.x1, inside.y1, inside.x0, inside.y0};
    for (const double u : {0.0, static_cast<double>(geometry.raw_width)}) {
      for (const double v : {0.0, static_cast<double>(geometry.raw_height)}) {
        const RayBundle::Line line = rays.line(u, v);
        for (const double z : {0.0, thickness}) {
          image.x0 = std::min(image.x0, line.x0 + line.x_per_z * z);
          image.x1 = std::max(image.x1, line.x0 + line.x_per_z * z);
          image.y0 = std::min(image.y0, line.y0 + line.y_per_z * z);
          image.y1 = std::max(image.y1, line.y0 + line.y_per_z * z);
        }
      }
    }
    // A ray that meets the region is never further from it than the ray's own lateral span.
    reach.x0 = std::min(reach.x0, std::max(image.x0, inside.x0 - dx));
    reach.y0 = std::min(reach.y0, std::max(image.y0, inside.y0 - dy));
    reach.x1 = std::max(reach.x1, std::min(image.x1, inside.x1 + dx));
    reach.y1 = std::max(reach.y1, std::min(image.y1, inside.y1 + dy));
  }
  return reach;
}

}  // namespace tomofield::geometry
