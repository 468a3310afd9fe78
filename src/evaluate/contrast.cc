#include "evaluate/contrast.h"

#include <fmt/core.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>

#include "base/statistics.h"
#include "base/threads/parallel.h"
#include "tomofield/error.h"

namespace tomofield::evaluate {
namespace {

struct Moments {
  double mean = 0.0, variance = 0.0;
};

template <typename Visit>
void for_each_voxel(const base::Volume& volume, const std::vector<base::Box>& boxes,
                    Visit&& visit) {
  for (const base::Box& box : boxes)
    for (std::int64_t z = box.begin[2]; z < box.end[2]; ++z)
      for (std::int64_t y = box.begin[1]; y < box.end[1]; ++y)
        for (std::int64_t x = box.begin[0]; x < box.end[0]; ++x)
          visit(static_cast<double>(volume.at(x, y, z)));
}

Moments moments(const base::Volume& volume, const std::vector<base::Box>& boxes) {
  double count = 0.0, sum = 0.0, squares = 0.0;
  for_each_voxel(volume, boxes, [&](double value) {
    count += 1.0;
    sum += value;
  });
  const double mean = sum / count;
  for_each_voxel(volume, boxes, [&](double value) { squares += (value - mean) * (value - mean); });
  return {mean, squares / count};
}

double cnr_of(const Moments& foreground, const Moments& background) {
  const double difference = std::abs(foreground.mean - background.mean);
  if (difference == 0.0) return 0.0;
  return difference / std::sqrt(0.5 * (foreground.variance + background.variance));
}

void require_finite(const base::Volume& volume) {
  const auto count = std::ranges::count_if(volume.data, [](float v) { return !std::isfinite(v); });
  if (count > 0)
    throw Error(
        fmt::format("{} of the volume's {} voxels are NaN or infinite: CNR and ENL need "
                    "numbers",
                    count, volume.data.size()));
}

void check_regions(const Regions& regions, const base::Shape3& shape) {
  const base::Box whole = whole_box(shape);
  for (const auto* boxes : {&regions.foreground, &regions.background}) {
    for (const base::Box& box : *boxes) {
      if (lies_within(box, whole)) continue;
      throw Error(fmt::format("the region {} must not be empty and must lie within {}, the volume",
                              to_text(box), to_text(whole)));
    }
  }
}

// Returns the cubes of the lattice in order of z, y, x.
std::vector<base::Box> lattice_cubes(const base::Shape3& shape) {
  const std::array<std::int64_t, 3> sizes{shape.nx, shape.ny, shape.nz};
  const std::int64_t side =
      std::clamp<std::int64_t>(*std::min_element(sizes.begin(), sizes.end()) / 8, 4, 32);
  const auto first = [&](std::size_t axis, std::int64_t cube) {
    return sizes[axis] % side / 2 + cube * side;
  };
  std::vector<base::Box> cubes;
  for (std::int64_t z = 0; z < shape.nz / side; ++z)
    for (std::int64_t y = 0; y < shape.ny / side; ++y)
      for (std::int64_t x = 0; x < shape.nx / side; ++x) {
        const std::array corner{first(0, x), first(1, y), first(2, z)};
        cubes.push_back({corner, {corner[0] + side, corner[1] + side, corner[2] + side}});
      }
  if (cubes.size() < 8)
    throw Error(
        fmt::format("{} × {} × {} voxels have only {} cubes of {} voxels a side to choose "
                    "regions from: give --foreground and --background",
                    shape.nx, shape.ny, shape.nz, cubes.size(), side));
  return cubes;
}

// Returns the index of the cube of smallest variance among the half nearest to the median mean.
std::size_t background_cube(const std::vector<Moments>& cubes) {
  std::vector<double> means;
  for (const Moments& cube : cubes) means.push_back(cube.mean);
  const std::size_t n = means.size();
  const double median = base::median(std::move(means));
  std::vector<std::size_t> nearest(n);
  std::iota(nearest.begin(), nearest.end(), std::size_t{0});
  std::ranges::stable_sort(nearest, {},
                           [&](std::size_t i) { return std::abs(cubes[i].mean - median); });
  nearest.resize((n + 1) / 2);
  std::ranges::sort(nearest);
  return *std::ranges::min_element(nearest, {}, [&](std::size_t i) { return cubes[i].variance; });
}

}  // namespace

ContrastScore contrast_score(const base::Volume& volume, const Regions& regions) {
  check_regions(regions, volume.shape);
  require_finite(volume);
  const auto [low, high] = std::ranges::minmax(volume.data);
  if (!(low < high))
    throw Error(fmt::format("every voxel of the volume is {}: it has no contrast", low));
  ContrastScore score{.low = static_cast<double>(low), .high = static_cast<double>(high)};
  const double range = score.high - score.low;
  const auto normalised = [&](const std::vector<base::Box>& boxes) {
    const Moments m = moments(volume, boxes);
    return Moments{(m.mean - score.low) / range, m.variance / (range * range)};
  };
  const Moments foreground = normalised(regions.foreground);
  const Moments background = normalised(regions.background);
  score.cnr = cnr_of(foreground, background);
  score.enl = background.variance > 0.0 ? background.mean * background.mean / background.variance
                                        : std::numeric_limits<double>::infinity();
  score.foreground_mean = foreground.mean;
  score.foreground_deviation = std::sqrt(foreground.variance);
  score.background_mean = background.mean;
  score.background_deviation = std::sqrt(background.variance);
  return score;
}

Regions choose_regions(const base::Volume& volume) {
  require_finite(volume);
  const std::vector<base::Box> cubes = lattice_cubes(volume.shape);
  std::vector<Moments> statistics(cubes.size());
  base::parallel_for("contrast", std::ssize(cubes), [&](std::int64_t c) {
    const auto i = static_cast<std::size_t>(c);
    statistics[i] = moments(volume, {cubes[i]});
  });
  const std::size_t background = background_cube(statistics);
  std::size_t foreground = background == 0 ? 1 : 0;
  const auto cnr = [&](std::size_t i) { return cnr_of(statistics[i], statistics[background]); };
  for (std::size_t i = 0; i < cubes.size(); ++i) {
    if (i != background && cnr(i) > cnr(foreground)) foreground = i;
  }
  return {{cubes[foreground]}, {cubes[background]}};
}

}  // namespace tomofield::evaluate
