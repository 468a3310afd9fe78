#include "evaluate/fourier_transform.h"

#include <kiss_fft.h>

#include <algorithm>
#include <cstdlib>
#include <memory>

#include "base/check.h"
#include "base/parallel.h"

namespace tomofield::evaluate {
namespace {

constexpr std::int64_t kTile = 16;  // lines copied together, 128 bytes of each row

// Transforms all lines of n values along one axis. Neighbours on a line are `stride` apart. The
// lines lie in bundles: `stride` lines beside each other, one bundle behind the other.
void transform_axis(std::int64_t n, std::int64_t stride, std::vector<std::complex<float>>& values) {
  const std::unique_ptr<void, decltype(&std::free)> plan(
      kiss_fft_alloc(static_cast<int>(n), 0, nullptr, nullptr), &std::free);
  TOMOFIELD_CHECK(plan != nullptr, "plan of the transform");
  const std::int64_t tiles = (stride + kTile - 1) / kTile;
  const std::int64_t bundles = std::ssize(values) / (n * stride);
  base::parallel_for(bundles * tiles, [&](std::int64_t task) {
    const std::int64_t first_line = task % tiles * kTile;
    const std::int64_t lines = std::min(kTile, stride - first_line);
    std::complex<float>* first = values.data() + task / tiles * n * stride + first_line;
    std::vector<kiss_fft_cpx> in(static_cast<std::size_t>(lines * n)), out(in.size());
    for (std::int64_t i = 0; i < n; ++i)
      for (std::int64_t l = 0; l < lines; ++l)
        in[static_cast<std::size_t>(l * n + i)] = {first[i * stride + l].real(),
                                                   first[i * stride + l].imag()};
    for (std::int64_t l = 0; l < lines; ++l)
      kiss_fft(static_cast<kiss_fft_cfg>(plan.get()), in.data() + l * n, out.data() + l * n);
    for (std::int64_t i = 0; i < n; ++i)
      for (std::int64_t l = 0; l < lines; ++l)
        first[i * stride + l] = {out[static_cast<std::size_t>(l * n + i)].r,
                                 out[static_cast<std::size_t>(l * n + i)].i};
  });
}

}  // namespace

void transform_volume(const base::Shape3& shape, std::vector<std::complex<float>>& values) {
  TOMOFIELD_CHECK(values.size() == shape.voxels(), "as many values as voxels");
  transform_axis(shape.nx, 1, values);
  transform_axis(shape.ny, shape.nx, values);
  transform_axis(shape.nz, shape.nx * shape.ny, values);
}

}  // namespace tomofield::evaluate
