#include "evaluate/resolution/block_fsc.h"

#include <array>

#include "base/check.h"
#include "base/trace.h"
#include "evaluate/box.h"
#include "io/images/mrc.h"

namespace tomofield::evaluate {

AxisBlocks divide_axis(std::int64_t n, std::int64_t most) {
  const std::int64_t count = (n + most - 1) / most;
  AxisBlocks blocks{.length = (n + count - 1) / count, .begin = {}};
  for (std::int64_t i = 0; i < count; ++i)
    blocks.begin.push_back(count == 1 ? 0 : i * (n - blocks.length) / (count - 1));
  return blocks;
}

Fsc correlate_blocks(const std::filesystem::path& first, const std::filesystem::path& second,
                     const std::optional<TiltRange>& tilts, std::int64_t largest_block) {
  const base::TraceSpan span("shell correlation");
  const io::MrcReader a(first), b(second);
  TOMOFIELD_CHECK(whole_box(a) == whole_box(b), "halves have one size");
  const AxisBlocks x = divide_axis(a.header().nx, largest_block);
  const AxisBlocks y = divide_axis(a.header().ny, largest_block);
  const AxisBlocks z = divide_axis(a.header().nz, largest_block);
  const base::Volume weights = edge_window({x.length, y.length, z.length});
  FscSums sums;
  for (const std::int64_t z0 : z.begin) {
    for (const std::int64_t y0 : y.begin) {
      for (const std::int64_t x0 : x.begin) {
        const base::Box box{{x0, y0, z0}, {x0 + x.length, y0 + y.length, z0 + z.length}};
        sums.add(read_box(a, box), read_box(b, box), weights, tilts);
      }
    }
  }
  return sums.correlation();
}

std::size_t block_fsc_memory(const base::Shape3& shape) {
  constexpr std::size_t kBytesOfVoxel = 20;  // two volumes, weights and a complex transform
  const auto length = [](std::int64_t n) { return divide_axis(n, kLargestBlock).length; };
  return kBytesOfVoxel *
         base::Shape3{length(shape.nx), length(shape.ny), length(shape.nz)}.voxels();
}

}  // namespace tomofield::evaluate
