#include "simulate/rasterize.h"

#include <algorithm>
#include <cmath>
#include <vector>

#include "base/check.h"
#include "base/parallel.h"

namespace tomofield::simulate {
namespace {

constexpr std::int64_t kBandRows = 64;

// Returns the centre of voxel `index` of `count` relative to the centre of the volume.
double centered(std::int64_t index, std::int64_t count) {
  return static_cast<double>(index) + 0.5 - static_cast<double>(count) / 2.0;
}

void add_body_to_row(const Ellipsoid& body, const base::Shape3& shape, double y, double z,
                     double* row) {
  const double dy = y - body.center[1], dz = z - body.center[2];
  const double half_width_squared = body.radius * body.radius - dy * dy - dz * dz;
  if (half_width_squared <= 0.0) return;
  const double half_width = std::sqrt(half_width_squared);
  const double pixel_of_zero = -centered(0, shape.nx);
  const double last_column = static_cast<double>(shape.nx - 1);
  const double first = std::max(std::ceil(body.center[0] - half_width + pixel_of_zero), 0.0);
  const double last =
      std::min(std::floor(body.center[0] + half_width + pixel_of_zero), last_column);
  if (first > last) return;
  for (auto i = static_cast<std::int64_t>(first); i <= static_cast<std::int64_t>(last); ++i)
    row[i] += body.density(centered(i, shape.nx) - body.center[0], dy, dz);
}

void rasterize_rows(const Phantom& phantom, std::int64_t section, std::int64_t first_row,
                    std::int64_t num_rows, float* out) {
  const base::Shape3& shape = phantom.shape;
  const double z = centered(section, shape.nz);
  const double low = centered(first_row, shape.ny), high = low + static_cast<double>(num_rows);
  std::vector<const Ellipsoid*> near;
  for (const Ellipsoid& body : phantom.bodies) {
    if (std::abs(body.center[2] - z) <= body.radius && body.center[1] + body.radius >= low &&
        body.center[1] - body.radius <= high)
      near.push_back(&body);
  }
  std::vector<double> sum(static_cast<std::size_t>(shape.nx));
  for (std::int64_t row = 0; row < num_rows; ++row) {
    std::fill(sum.begin(), sum.end(), phantom.slab_density);
    const double y = centered(first_row + row, shape.ny);
    for (const Ellipsoid* body : near) add_body_to_row(*body, shape, y, z, sum.data());
    std::transform(sum.begin(), sum.end(), out + row * shape.nx,
                   [](double value) { return static_cast<float>(value); });
  }
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
  return density;
}

void rasterize_sections(const Phantom& phantom, std::int64_t first_section,
                        std::int64_t num_sections, std::span<float> sections) {
  const base::Shape3& shape = phantom.shape;
  TOMOFIELD_CHECK(static_cast<std::int64_t>(sections.size()) == num_sections * shape.ny * shape.nx,
                  "the sections' buffer has another size");
  const std::int64_t bands = (shape.ny + kBandRows - 1) / kBandRows;
  base::parallel_for("rasterize", num_sections * bands, [&](std::int64_t unit) {
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
