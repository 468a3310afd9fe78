#include "evaluate/speckle.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <numeric>
#include <vector>

#include "base/threads/parallel.h"
#include "tomofield/error.h"

namespace tomofield::evaluate {
namespace {

// Neighbouring voxels along x that are compared together.
constexpr std::int64_t kRun = 256;
using Floats = std::array<float, kRun>;
using Counts = std::array<std::int32_t, kRun>;

// The median of 27 voxels is below a limit if at least these are.
constexpr std::int32_t kMajority = 14;

// Compares the voxels of a row, and those before and after each of them, with the limits.
void compare_row(const float* row, const Floats& low, const Floats& high, std::int64_t count,
                 Counts& below, Counts& above) {
  for (std::int64_t i = 0; i < count; ++i) {
    const auto at = static_cast<std::size_t>(i);
    const float before = row[i - 1], here = row[i], after = row[i + 1];
    below[at] += (before < low[at]) + (here < low[at]) + (after < low[at]);
    above[at] += (before > high[at]) + (here > high[at]) + (after > high[at]);
  }
}

// Counts the speckles among `count` voxels from (x, y, z) on. Instead of the median it looks
// whether a majority of the neighbours lies beyond one deviation.
std::int64_t speckles_of_run(const VoxelBlock& block, std::int64_t x, std::int64_t y,
                             std::int64_t z, std::int64_t count, float deviation) {
  Floats low, high;
  Counts below{}, above{};
  const float* const centre = block.row(y, z) + x;
  for (std::int64_t i = 0; i < count; ++i) {
    low[static_cast<std::size_t>(i)] = centre[i] - deviation;
    high[static_cast<std::size_t>(i)] = centre[i] + deviation;
  }
  for (std::int64_t dz = -1; dz <= 1; ++dz)
    for (std::int64_t dy = -1; dy <= 1; ++dy)
      compare_row(block.row(y + dy, z + dz) + x, low, high, count, below, above);
  std::int64_t speckles = 0;
  for (std::size_t i = 0; i < static_cast<std::size_t>(count); ++i)
    speckles += below[i] >= kMajority || above[i] >= kMajority;
  return speckles;
}

// Returns the sum of term(voxel) over all voxels, section by section.
template <typename Term>
double sum_of(const base::Volume& volume, const Term& term) {
  std::vector<double> sums(static_cast<std::size_t>(volume.shape.nz));
  const std::int64_t size = volume.shape.nx * volume.shape.ny;
  base::parallel_for("moments", volume.shape.nz, [&](std::int64_t z) {
    const float* section = volume.data.data() + z * size;
    double sum = 0.0;
    for (std::int64_t i = 0; i < size; ++i) sum += term(static_cast<double>(section[i]));
    sums[static_cast<std::size_t>(z)] = sum;
  });
  return std::accumulate(sums.begin(), sums.end(), 0.0);
}

double standard_deviation(const base::Volume& volume) {
  const auto count = static_cast<double>(volume.data.size());
  const double mean = sum_of(volume, [](double v) { return v; }) / count;
  const double squares = sum_of(volume, [mean](double v) { return (v - mean) * (v - mean); });
  if (!std::isfinite(squares))
    throw Error("the volume has NaN or infinite voxels: speckle needs numbers");
  return std::sqrt(squares / count);
}

}  // namespace

std::int64_t count_speckles(const VoxelBlock& block, double deviation) {
  std::int64_t speckles = 0;
  for (std::int64_t z = 1; z + 1 < block.shape.nz; ++z)
    for (std::int64_t y = 1; y + 1 < block.shape.ny; ++y)
      for (std::int64_t x = 1; x + 1 < block.shape.nx; x += kRun)
        speckles += speckles_of_run(block, x, y, z, std::min(kRun, block.shape.nx - 1 - x),
                                    static_cast<float>(deviation));
  return speckles;
}

std::int64_t num_inner_voxels(const base::Shape3& shape) {
  const auto inner = [](std::int64_t n) { return std::max<std::int64_t>(n - 2, 0); };
  return inner(shape.nx) * inner(shape.ny) * inner(shape.nz);
}

std::optional<double> speckle(const base::Volume& volume) {
  const std::int64_t inner = num_inner_voxels(volume.shape);
  const double deviation = standard_deviation(volume);
  if (inner == 0) return std::nullopt;
  const VoxelBlock block = block_of(volume);
  std::vector<std::int64_t> speckles(static_cast<std::size_t>(volume.shape.nz - 2));
  base::parallel_for("speckle", std::ssize(speckles), [&](std::int64_t z) {
    speckles[static_cast<std::size_t>(z)] = count_speckles(block.sections(z, 3), deviation);
  });
  const auto all = std::accumulate(speckles.begin(), speckles.end(), std::int64_t{0});
  return static_cast<double>(all) / static_cast<double>(inner);
}

}  // namespace tomofield::evaluate
