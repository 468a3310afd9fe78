#include "simulate/cryo/particle_files.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "io/tables/star_file.h"
#include "simulate/gaussian_rows.h"
#include "simulate/rasterize.h"
#include "tomofield/error.h"

namespace tomofield::simulate {
namespace {

constexpr const char* kKind = "tomofieldParticleKind";

}  // namespace

std::string particle_list(const CryoSpecimen& specimen) {
  io::StarTable table("particles", {"rlnCoordinateX", "rlnCoordinateY", "rlnCoordinateZ",
                                    "rlnAngleRot", "rlnAngleTilt", "rlnAnglePsi", kKind});
  const base::Shape3& shape = specimen.phantom.shape;
  const Vector3 size{static_cast<double>(shape.nx), static_cast<double>(shape.ny),
                     static_cast<double>(shape.nz)};
  for (const PlacedParticle& particle : specimen.particles) {
    const Vector3 corner = moved(particle.center_px, 0.5, size);
    bool is_inside = true;
    for (std::size_t a = 0; a < 3; ++a)
      is_inside = is_inside && corner[a] >= 0.0 && corner[a] < size[a];
    if (!is_inside) continue;
    std::vector<std::string> cells;
    for (const double value : corner) cells.push_back(fmt::format("{:.3f}", value));
    for (const double value : particle.euler_deg) cells.push_back(fmt::format("{:.3f}", value));
    cells.push_back(specimen.kinds[particle.kind].name);
    table.add_row(std::move(cells));
  }
  return io::star_file_text(table);
}

std::set<std::string> listed_kinds(const std::filesystem::path& list) {
  std::set<std::string> kinds;
  try {
    const std::vector<io::StarTable> tables = io::read_star_file(list);
    const io::StarTable* const table = io::find_table(tables, kKind);
    for (std::size_t row = 0; table != nullptr && row < table->num_rows(); ++row) {
      const std::string kind = table->find(row, kKind).value_or("");
      if (std::filesystem::path(kind).filename() == kind) kinds.insert(kind);
    }
  } catch (const Error&) {
    // There is none, or it is not of a simulation.
  }
  return kinds;
}

base::Volume reference_density(const ParticleKind& kind, double voxel_size_A) {
  Phantom phantom;
  double reach = 0.0;
  for (const Gaussian& gaussian : kind.reference) {
    phantom.blobs.push_back(blob_of(gaussian, voxel_size_A));
    reach = std::max(reach, 3.0 * phantom.blobs.back().sigma);
  }
  const auto half =
      static_cast<std::int64_t>(std::ceil(radius_A(kind.reference) / voxel_size_A + reach));
  phantom.shape = {2 * half, 2 * half, 2 * half};
  return rasterize(phantom, voxel_size_A);
}

base::Volume membrane_label(const CryoSpecimen& specimen, double voxel_size_A) {
  const double radius = 25.0 / voxel_size_A;
  base::Volume label(specimen.phantom.shape, voxel_size_A);
  const base::Shape3& shape = label.shape;
  const auto start = [](std::int64_t n) { return 0.5 - static_cast<double>(n) / 2.0; };
  for (const Vector3& p : specimen.membrane_points_px) {
    const IndexRange zs = indices_near(p[2], radius, start(shape.nz), shape.nz);
    const IndexRange ys = indices_near(p[1], radius, start(shape.ny), shape.ny);
    const IndexRange xs = indices_near(p[0], radius, start(shape.nx), shape.nx);
    for (std::int64_t z = zs.first; z < zs.last; ++z)
      for (std::int64_t y = ys.first; y < ys.last; ++y)
        for (std::int64_t x = xs.first; x < xs.last; ++x) {
          const Vector3 d{start(shape.nx) + static_cast<double>(x) - p[0],
                          start(shape.ny) + static_cast<double>(y) - p[1],
                          start(shape.nz) + static_cast<double>(z) - p[2]};
          if (dot(d, d) <= radius * radius) label.at(x, y, z) = 1.0f;
        }
  }
  return label;
}

}  // namespace tomofield::simulate
