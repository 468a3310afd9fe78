#include "simulate/project_phantom.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "base/check.h"
#include "base/parallel.h"
#include "simulate/gaussian_rows.h"

namespace tomofield::simulate {
namespace {

constexpr std::int64_t kBandRows = 16;

// Holds a view with the sine and the cosine of its tilt.
struct Beam {
  explicit Beam(const ViewFrame& v)
      : view(v),
        cosine(std::cos(v.tilt_deg * std::numbers::pi / 180.0)),
        sine(std::sin(v.tilt_deg * std::numbers::pi / 180.0)) {}
  // Return the position of a pixel centre relative to the specimen's centre.
  double x_of(std::int64_t pixel) const {
    return static_cast<double>(pixel) + 0.5 - static_cast<double>(view.width) / 2.0 -
           view.shift_x_px;
  }
  double y_of(std::int64_t row) const {
    return static_cast<double>(row) + 0.5 - static_cast<double>(view.height) / 2.0 -
           view.shift_y_px;
  }
  ViewFrame view;
  double cosine;
  double sine;
};

// Adds one ellipsoid to one row. Let o be the point of the ray in the plane through the body's
// centre that is nearest to the centre, and d the ray's direction. The ray o + t d meets pᵀ Q p = s
// where A t² + 2 B t + E − s = 0, with A = dᵀQd, B = oᵀQd, E = oᵀQo. The chord between these points
// is 2 √(B² − A (E − s)) / A.
void add_ellipsoid_to_row(const Ellipsoid& body, const Beam& beam, double y, double* row) {
  const double offset_y = y - body.center[1];
  const double half_width_squared = body.radius * body.radius - offset_y * offset_y;
  if (half_width_squared <= 0.0) return;
  const double half_width = std::sqrt(half_width_squared);
  const double center_u = body.center[0] * beam.cosine + body.center[2] * beam.sine;
  // Only pixels whose centres lie within the bounding sphere's chord of this row can change.
  const IndexRange columns = indices_near(center_u, half_width, beam.x_of(0), beam.view.width);
  if (columns.last <= columns.first) return;

  const auto& q = body.q;
  const double c = beam.cosine, s = beam.sine;
  const double qd_x = -q[0] * s + q[4] * c, qd_y = -q[3] * s + q[5] * c,
               qd_z = -q[4] * s + q[2] * c;
  const double a = -s * qd_x + c * qd_z;
  const double b_per_u = c * qd_x + s * qd_z, b_from_y = offset_y * qd_y;
  const double inner = body.ratio * body.ratio;
  const double step_in = body.inside_density - body.wall_density;
  for (std::int64_t i = columns.first; i < columns.last; ++i) {
    const double u = beam.x_of(i) - center_u;
    const double b = b_per_u * u + b_from_y;
    const double base = b * b - a * body.form(u * c, offset_y, u * s);
    const double outer_chord = std::sqrt(std::max(base + a, 0.0));
    const double inner_chord = std::sqrt(std::max(base + a * inner, 0.0));
    row[i] += 2.0 / a * (body.wall_density * outer_chord + step_in * inner_chord);
  }
}

// Returns the length of the ray x = u cos θ − t sin θ, z = u sin θ + t cos θ inside the box
// |x| <= half_width, |z| <= half_thickness.
double box_chord(const Beam& beam, double u, double half_width, double half_thickness) {
  double enter = -1e300, leave = 1e300;
  const auto clip = [&](double origin, double direction, double half) {
    if (std::abs(direction) < 1e-12) {
      if (std::abs(origin) > half) leave = enter;
      return;
    }
    const double t0 = (-half - origin) / direction, t1 = (half - origin) / direction;
    enter = std::max(enter, std::min(t0, t1));
    leave = std::min(leave, std::max(t0, t1));
  };
  clip(u * beam.cosine, -beam.sine, half_width);
  clip(u * beam.sine, beam.cosine, half_thickness);
  return std::max(leave - enter, 0.0);
}

void add_slab_to_row(const Phantom& phantom, const Beam& beam, double y, double* row) {
  const double half_width = static_cast<double>(phantom.shape.nx) / 2.0;
  const double half_height = static_cast<double>(phantom.shape.ny) / 2.0;
  const double thickness = static_cast<double>(phantom.shape.nz);
  if (!phantom.is_extended && std::abs(y) > half_height) return;
  for (std::int64_t i = 0; i < beam.view.width; ++i) {
    const double path = phantom.is_extended
                            ? thickness / beam.cosine
                            : box_chord(beam, beam.x_of(i), half_width, thickness / 2.0);
    row[i] += phantom.slab_density * path;
  }
}

// Adds one blob to rows. At the distance t along a ray from the point nearest to the blob's centre,
// the blob has exp(−t² / 2σ²) of its density in that point. The ray x = u cos θ − t' sin θ,
// z = u sin θ + t' cos θ is within the slab for |z| <= half_thickness.
void add_blob(const Blob& blob, const Beam& beam, double half_thickness, const PixelRows& rows) {
  const double c = beam.cosine, s = beam.sine;
  const double center_u = blob.center[0] * c + blob.center[2] * s;
  const double center_t = -blob.center[0] * s + blob.center[2] * c;
  const double unit = std::numbers::sqrt2 * blob.sigma;
  const double factor = blob.peak * blob.sigma * std::sqrt(std::numbers::pi / 2.0);
  const auto integral = [&](double u) {
    const double enter = (-half_thickness - u * s) / c - center_t;
    const double leave = (half_thickness - u * s) / c - center_t;
    return factor * (std::erf(leave / unit) - std::erf(enter / unit));
  };
  add_gaussian(center_u, blob.center[1], blob.sigma, blob.reach(), integral, rows);
}

// Returns the bodies that a row with y in [low, high] can meet.
template <typename Body>
std::vector<const Body*> bodies_between(std::span<const Body> bodies, double low, double high) {
  std::vector<const Body*> near;
  for (const Body& body : bodies) {
    if (body.center[1] + body.reach() < low || body.center[1] - body.reach() > high) continue;
    near.push_back(&body);
  }
  return near;
}

}  // namespace

std::vector<double> project_ellipsoids(std::span<const Ellipsoid> bodies, const ViewFrame& view) {
  const Beam beam(view);
  std::vector<double> image(static_cast<std::size_t>(view.width * view.height));
  for (std::int64_t row = 0; row < view.height; ++row) {
    for (const Ellipsoid& body : bodies)
      add_ellipsoid_to_row(body, beam, beam.y_of(row), image.data() + row * view.width);
  }
  return image;
}

void project_rows(const Phantom& phantom, const ViewFrame& view, std::int64_t first_row,
                  std::int64_t num_rows, std::span<float> rows) {
  TOMOFIELD_CHECK(static_cast<std::int64_t>(rows.size()) == num_rows * view.width,
                  "the rows' buffer has another size");
  const Beam beam(view);
  const double low = beam.y_of(first_row), high = beam.y_of(first_row + num_rows - 1);
  std::vector<double> sums(rows.size());
  const auto ellipsoids = bodies_between<Ellipsoid>(phantom.bodies, low, high);
  for (std::int64_t row = 0; row < num_rows; ++row) {
    double* const sum = sums.data() + row * view.width;
    const double y = beam.y_of(first_row + row);
    add_slab_to_row(phantom, beam, y, sum);
    for (const Ellipsoid* body : ellipsoids) add_ellipsoid_to_row(*body, beam, y, sum);
  }
  const double half_thickness = static_cast<double>(phantom.shape.nz) / 2.0;
  const PixelRows pixels{.origin_x = beam.x_of(0),
                         .origin_y = beam.y_of(0),
                         .first_row = first_row,
                         .width = view.width,
                         .values = sums};
  for (const Blob* blob : bodies_between<Blob>(phantom.blobs, low, high))
    add_blob(*blob, beam, half_thickness, pixels);
  std::transform(sums.begin(), sums.end(), rows.begin(),
                 [](double value) { return static_cast<float>(value); });
}

void project_view(const Phantom& phantom, const ViewFrame& view, std::span<float> image) {
  const std::int64_t num_bands = (view.height + kBandRows - 1) / kBandRows;
  base::parallel_for("project phantom", num_bands, [&](std::int64_t band) {
    const std::int64_t first = band * kBandRows;
    const std::int64_t count = std::min(kBandRows, view.height - first);
    project_rows(phantom, view, first, count,
                 image.subspan(static_cast<std::size_t>(first * view.width),
                               static_cast<std::size_t>(count * view.width)));
  });
}

}  // namespace tomofield::simulate
