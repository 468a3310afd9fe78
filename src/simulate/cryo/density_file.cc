#include "simulate/cryo/density_file.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <utility>
#include <vector>

#include "base/statistics.h"
#include "evaluate/box.h"
#include "io/images/mrc_format.h"
#include "tomofield/error.h"

namespace tomofield::simulate {
namespace {

constexpr double kCube_A = 8.0;
constexpr std::size_t kMostGaussians = 50'000;

// Returns the median of the outermost voxels of a map.
double median_of_faces(const base::Volume& map) {
  const base::Shape3& n = map.shape;
  std::vector<float> faces;
  for (std::int64_t z = 0; z < n.nz; ++z)
    for (std::int64_t y = 0; y < n.ny; ++y)
      for (std::int64_t x = 0; x < n.nx; ++x)
        if (std::min({x, y, z, n.nx - 1 - x, n.ny - 1 - y, n.nz - 1 - z}) == 0)
          faces.push_back(map.at(x, y, z));
  return base::median(std::move(faces));
}

// Returns the potential in V of a unit of density. Sets `solvent` to the density below which there
// is no protein.
double potential_of_unit(const base::Volume& map, const std::filesystem::path& path,
                         double& solvent) {
  const double high = base::percentile(map.data, 99.9);
  if (!(high > 0.0))
    throw Error(fmt::format(
        "'{}' has no density above 0: give a map in which the particle is high and solvent near 0",
        path.string()));
  constexpr double kMostSolvent = 0.1;
  const double outside = median_of_faces(map);
  if (std::fabs(outside) > kMostSolvent * high)
    throw Error(fmt::format(
        "'{}' has {:.4g} at its faces and up to {:.4g} within: give a map in which the particle is "
        "high and solvent near 0",
        path.string(), outside, high));
  double sum = 0.0, count = 0.0;
  for (const float value : map.data) {
    if (static_cast<double>(value) <= 0.5 * high) continue;
    sum += static_cast<double>(value);
    count += 1.0;
  }
  solvent = 0.1 * high;
  return kPotentialPerDalton_VA3 / kVolumePerDalton_A3 / (sum / count);
}

// Sums the protein of one cube of voxels.
Gaussian cube_at(const base::Volume& map, const std::array<std::int64_t, 3>& first,
                 std::int64_t side, double solvent) {
  const base::Shape3& n = map.shape;
  Gaussian cube;
  for (std::int64_t z = first[2]; z < std::min(first[2] + side, n.nz); ++z)
    for (std::int64_t y = first[1]; y < std::min(first[1] + side, n.ny); ++y)
      for (std::int64_t x = first[0]; x < std::min(first[0] + side, n.nx); ++x) {
        const auto value = static_cast<double>(map.at(x, y, z));
        if (value <= solvent) continue;
        const Vector3 at{static_cast<double>(x), static_cast<double>(y), static_cast<double>(z)};
        cube.center_A = moved(cube.center_A, value, at);
        cube.integral_VA3 += value;
      }
  return cube;
}

}  // namespace

std::vector<Gaussian> read_density(const std::filesystem::path& path) {
  const base::Volume map = evaluate::read_volume(path);
  const double voxel_A = map.voxel_size_A;
  evaluate::require_numbers(map, path);
  if (!io::is_known_size(voxel_A))
    throw Error(fmt::format("'{}' has no voxel size: set that of its header", path.string()));
  double solvent = 0.0;
  const double unit_V = potential_of_unit(map, path, solvent);
  const base::Shape3& n = map.shape;
  const auto side =
      std::clamp<std::int64_t>(std::llround(kCube_A / voxel_A), 1, std::max({n.nx, n.ny, n.nz}));
  const Vector3 middle{static_cast<double>(n.nx) / 2.0 - 0.5, static_cast<double>(n.ny) / 2.0 - 0.5,
                       static_cast<double>(n.nz) / 2.0 - 0.5};
  std::vector<Gaussian> gaussians;
  for (std::int64_t z = 0; z < n.nz; z += side)
    for (std::int64_t y = 0; y < n.ny; y += side)
      for (std::int64_t x = 0; x < n.nx; x += side) {
        Gaussian cube = cube_at(map, {x, y, z}, side, solvent);
        if (cube.integral_VA3 <= 0.0) continue;
        const Vector3 mean = moved({}, 1.0 / cube.integral_VA3, cube.center_A);
        cube.center_A = moved({}, voxel_A, moved(mean, -1.0, middle));
        cube.sigma_A = 0.45 * static_cast<double>(side) * voxel_A;
        cube.integral_VA3 *= unit_V * voxel_A * voxel_A * voxel_A;
        gaussians.push_back(cube);
      }
  if (gaussians.size() > kMostGaussians)
    throw Error(fmt::format(
        "'{}' has {} cubes of {:.0f} Å with density, more than {}: cut out a single particle",
        path.string(), gaussians.size(), static_cast<double>(side) * voxel_A, kMostGaussians));
  return gaussians;
}

}  // namespace tomofield::simulate
