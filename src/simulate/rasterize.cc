#include "simulate/rasterize.h"

#include <algorithm>
#include <cmath>
#include <vector>

#include "base/check.h"
#include "base/progress.h"
#include "base/threads/parallel.h"
#include "simulate/gaussian_rows.h"

namespace tomofield::simulate {
namespace {

constexpr std::int64_t kBandRows = 64;

// Returns the centre of voxel `index` of `count` relative to the centre of the volume.
double centered(std::int64_t index, std::int64_t count) {
  return static_cast<double>(index) + 0.5 - static_cast<double>(count) / 2.0;
}

void add_ellipsoid_to_row(const Ellipsoid& body, const base::Shape3& shape, double y, double z,
                          double* row) {
  const double dy = y - body.center[1], dz = z - body.center[2];
  const double half_width_squared = body.radius * body.radius - dy * dy - dz * dz;
  if (half_width_squared <= 0.0) return;
  const double half_width = std::sqrt(half_width_squared);
  const IndexRange columns =
      indices_near(body.center[0], half_width, centered(0, shape.nx), shape.nx);
  for (std::int64_t i = columns.first; i < columns.last; ++i)
    row[i] += body.density(centered(i, shape.nx) - body.center[0], dy, dz);
}

void add_blob(const Blob& blob, double z, const PixelRows& rows) {
  const double density = blob.density(0.0, 0.0, z - blob.center[2]);
  add_gaussian(
      blob.center[0], blob.center[1], blob.sigma, blob.reach(), [&](double) { return density; },
      rows);
}

// Returns the bodies that a row at z, with y in [low, high], can meet.
template <typename Body>
std::vector<const Body*> bodies_near(std::span<const Body> bodies, double z, double low,
                                     double high) {
  std::vector<const Body*> near;
  for (const Body& body : bodies) {
    const double reach = body.reach();
    if (std::abs(body.center[2] - z) <= reach && body.center[1] + reach >= low &&
        body.center[1] - reach <= high)
      near.push_back(&body);
  }
  return near;
}

void rasterize_rows(const Phantom& phantom, std::int64_t section, std::int64_t first_row,
                    std::int64_t num_rows, float* out) {
  const base::Shape3& shape = phantom.shape;
  const double z = centered(section, shape.nz);
  const double low = centered(first_row, shape.ny), high = low + static_cast<double>(num_rows);
  std::vector<double> sums(static_cast<std::size_t>(num_rows * shape.nx), phantom.slab_density);
  for (const Ellipsoid* body : bodies_near<Ellipsoid>(phantom.bodies, z, low, high)) {
    for (std::int64_t row = 0; row < num_rows; ++row) {
      const double y = centered(first_row + row, shape.ny);
      add_ellipsoid_to_row(*body, shape, y, z, sums.data() + row * shape.nx);
    }
  }
  const PixelRows voxels{.origin_x = centered(0, shape.nx),
                         .origin_y = centered(0, shape.ny),
                         .first_row = first_row,
                         .width = shape.nx,
                         .values = sums};
  for (const Blob* blob : bodies_near<Blob>(phantom.blobs, z, low, high))
    add_blob(*blob, z, voxels);
  std::transform(sums.begin(), sums.end(), out,
                 [](double value) { return static_cast<float>(value); });
}

}  // namespace

double density_at(const Phantom& phantom, double x, double y, double z) {
  const auto beyond = [](double position, std::int64_t count) {
    return std::abs(position) > static_cast<double>(count) / 2.0;
  };
  const bool is_outside =
      beyond(z, phantom.shape.nz) ||
      (!phantom.is_extended && (beyond(x, phantom.shape.nx) || beyond(y, phantom.shape.ny)));
  double density = is_outside ? 0.0 : phantom.slab_density;
  for (const Ellipsoid& body : phantom.bodies)
    density += body.density(x - body.center[0], y - body.center[1], z - body.center[2]);
  if (beyond(z, phantom.shape.nz)) return density;
  for (const Blob& blob : phantom.blobs)
    density += blob.density(x - blob.center[0], y - blob.center[1], z - blob.center[2]);
  return density;
}

void rasterize_sections(const Phantom& phantom, std::int64_t first_section,
                        std::int64_t num_sections, std::span<float> sections) {
  const base::Shape3& shape = phantom.shape;
  TOMOFIELD_CHECK(static_cast<std::int64_t>(sections.size()) == num_sections * shape.ny * shape.nx,
                  "the sections' buffer has another size");
  const std::int64_t bands = (shape.ny + kBandRows - 1) / kBandRows;
  base::parallel_for("rasterize", num_sections * bands, [&](std::int64_t unit) {
    base::allow_interruption();
    const std::int64_t section = unit / bands;
    const std::int64_t first_row = unit % bands * kBandRows;
    const std::int64_t num_rows = std::min(kBandRows, shape.ny - first_row);
    rasterize_rows(phantom, first_section + section, first_row, num_rows,
                   sections.data() + (section * shape.ny + first_row) * shape.nx);
  });
}

base::Volume rasterize(const Phantom& phantom, double voxel_size_A) {
  base::Volume volume(phantom.shape, voxel_size_A);
  rasterize_sections(phantom, 0, phantom.shape.nz, volume.data);
  return volume;
}

}  // namespace tomofield::simulate
