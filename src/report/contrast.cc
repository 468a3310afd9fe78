#include "report/contrast.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "base/statistics.h"
#include "base/threads/parallel.h"

namespace tomofield::report {
namespace {

constexpr double kOuter = 0.5, kInner = 2.0, kMostTimes = 3.0;

}  // namespace

std::array<std::int64_t, 3> middle_size(const std::array<std::int64_t, 3>& size) {
  std::array<std::int64_t, 3> middle = size;
  const auto shortest = std::ranges::min_element(size) - size.begin();
  for (std::size_t axis = 0; axis < 3; ++axis) {
    const bool is_thickness = static_cast<std::ptrdiff_t>(axis) == shortest;
    middle[axis] = std::max<std::int64_t>(1, is_thickness ? size[axis] / 2 : 3 * size[axis] / 4);
  }
  return middle;
}

Contrast contrast_of(std::vector<float> values) {
  std::erase_if(values, [](float value) { return !std::isfinite(value); });
  if (values.empty()) return {};
  const double median = base::median(values);
  const auto limit = [&](double outer, double inner) {
    const double from_median = base::percentile(values, outer) - median;
    const double most = kMostTimes * (base::percentile(values, inner) - median);
    // A specimen that fills less than the inner percentile leaves nothing to compare with.
    return median + (most != 0.0 && std::abs(most) < std::abs(from_median) ? most : from_median);
  };
  const Contrast contrast{limit(kOuter, kInner), limit(100 - kOuter, 100 - kInner)};
  return {contrast.black, contrast.white > contrast.black ? contrast.white : contrast.black + 1};
}

Contrast contrast_of(const io::MrcReader& volume) {
  constexpr std::int64_t kSections = 32, kMostVoxels = std::int64_t{1} << 22;
  const io::MrcHeader& h = volume.header();
  const auto size = middle_size({h.nx, h.ny, h.nz});
  const std::int64_t nx = size[0], ny = size[1], nz = size[2];
  const std::int64_t x0 = (h.nx - nx) / 2, y0 = (h.ny - ny) / 2, z0 = (h.nz - nz) / 2;
  const std::int64_t sections = std::min(nz, kSections);
  const std::int64_t stride = nx * ny * sections / kMostVoxels + 1;
  std::vector<std::vector<float>> samples(static_cast<std::size_t>(sections));
  base::parallel_for("sample the middle", sections, [&](std::int64_t i) {
    std::vector<float> row(static_cast<std::size_t>(h.nx));
    std::int64_t skip = 0;  // voxels of the next row before the next of the sample
    for (std::int64_t y = 0; y < ny; ++y) {
      volume.read_rows(z0 + (2 * i + 1) * nz / (2 * sections), y0 + y, 1, row);
      std::int64_t x = skip;
      for (; x < nx; x += stride)
        samples[static_cast<std::size_t>(i)].push_back(row[static_cast<std::size_t>(x0 + x)]);
      skip = x - nx;
    }
  });
  std::vector<float> values;
  for (const auto& sample : samples) values.insert(values.end(), sample.begin(), sample.end());
  return contrast_of(std::move(values));
}

}  // namespace tomofield::report
