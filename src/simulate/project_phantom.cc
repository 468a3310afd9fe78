#include "simulate/project_phantom.h"

#include <algorithm>
#include <cmath>

#include "base/check.h"
#include "base/progress.h"
#include "base/threads/parallel.h"
#include "simulate/gaussian_rows.h"
#include "simulate/line_integrals.h"
#include "simulate/project_pixels.h"

namespace tomofield::simulate {
namespace {

constexpr std::int64_t kBandRows = 16;

// Holds the places of the pixels of a view that keeps its rows.
struct Rows {
  explicit Rows(const ViewFrame& v) : view(v), beam(v.tilt_deg) {
    TOMOFIELD_CHECK(v.keeps_rows(), "the rows of the view are turned or warped");
  }
  // Return the position of a pixel centre relative to the specimen's centre.
  double x_of(std::int64_t pixel) const {
    return static_cast<double>(pixel) + 0.5 - static_cast<double>(view.width) / 2.0 -
           view.raw_from_aligned.shift_x_px;
  }
  double y_of(std::int64_t row) const {
    return static_cast<double>(row) + 0.5 - static_cast<double>(view.height) / 2.0 -
           view.raw_from_aligned.shift_y_px;
  }
  const ViewFrame& view;
  Beam beam;
};

void add_ellipsoid_to_row(const Ellipsoid& body, const Rows& rows, double y, double* row) {
  const double offset_y = y - body.center[1];
  const double half_width_squared = body.radius * body.radius - offset_y * offset_y;
  if (half_width_squared <= 0.0) return;
  const double half_width = std::sqrt(half_width_squared);
  const double center_u = rows.beam.u_of(body.center);
  // Only pixels whose centres lie within the bounding sphere's chord of this row can change.
  const IndexRange columns = indices_near(center_u, half_width, rows.x_of(0), rows.view.width);
  if (columns.last <= columns.first) return;
  const EllipsoidIntegral integral(body, rows.beam);
  for (std::int64_t i = columns.first; i < columns.last; ++i)
    row[i] += integral(rows.x_of(i) - center_u, offset_y);
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

// Adds the integrals through a phantom and its slab to rows of a view that keeps its rows.
void add_rows(const Phantom& phantom, const ViewFrame& view, std::int64_t first_row,
              std::span<double> sums) {
  const Rows rows(view);
  const std::int64_t num_rows = static_cast<std::int64_t>(sums.size()) / view.width;
  const double low = rows.y_of(first_row), high = rows.y_of(first_row + num_rows - 1);
  const auto ellipsoids = bodies_between<Ellipsoid>(phantom.bodies, low, high);
  for (std::int64_t row = 0; row < num_rows; ++row) {
    double* const sum = sums.data() + row * view.width;
    const double y = rows.y_of(first_row + row);
    for (std::int64_t i = 0; i < view.width; ++i)
      sum[i] += slab_integral(phantom, rows.beam, rows.x_of(i), y);
    for (const Ellipsoid* body : ellipsoids) add_ellipsoid_to_row(*body, rows, y, sum);
  }
  const double half_thickness = static_cast<double>(phantom.shape.nz) / 2.0;
  const PixelRows pixels{.origin_x = rows.x_of(0),
                         .origin_y = rows.y_of(0),
                         .first_row = first_row,
                         .width = view.width,
                         .values = sums};
  for (const Blob* blob : bodies_between<Blob>(phantom.blobs, low, high))
    add_gaussian(rows.beam.u_of(blob->center), blob->center[1], blob->sigma, blob->reach(),
                 BlobIntegral(*blob, rows.beam, half_thickness), pixels);
}

}  // namespace

std::vector<double> project_ellipsoids(std::span<const Ellipsoid> bodies, const ViewFrame& view) {
  const Rows rows(view);
  std::vector<double> image(static_cast<std::size_t>(view.width * view.height));
  for (std::int64_t row = 0; row < view.height; ++row) {
    for (const Ellipsoid& body : bodies)
      add_ellipsoid_to_row(body, rows, rows.y_of(row), image.data() + row * view.width);
  }
  return image;
}

void project_rows(const Phantom& phantom, const ViewFrame& view, std::int64_t first_row,
                  std::int64_t num_rows, std::span<float> rows) {
  TOMOFIELD_CHECK(static_cast<std::int64_t>(rows.size()) == num_rows * view.width,
                  "the rows' buffer has another size");
  std::vector<double> sums(rows.size());
  if (view.keeps_rows())
    add_rows(phantom, view, first_row, sums);
  else
    add_pixels(phantom, view, first_row, sums);
  std::transform(sums.begin(), sums.end(), rows.begin(),
                 [](double value) { return static_cast<float>(value); });
}

void project_view(const Phantom& phantom, const ViewFrame& view, std::span<float> image) {
  const std::int64_t num_bands = (view.height + kBandRows - 1) / kBandRows;
  base::parallel_for("project phantom", num_bands, [&](std::int64_t band) {
    base::allow_interruption();
    const std::int64_t first = band * kBandRows;
    const std::int64_t count = std::min(kBandRows, view.height - first);
    project_rows(phantom, view, first, count,
                 image.subspan(static_cast<std::size_t>(first * view.width),
                               static_cast<std::size_t>(count * view.width)));
  });
}

}  // namespace tomofield::simulate
