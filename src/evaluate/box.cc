#include "evaluate/box.h"

#include <fmt/core.h>

#include <algorithm>
#include <cmath>
#include <vector>

#include "base/system/memory.h"
#include "io/images/mrc_format.h"
#include "tomofield/error.h"

namespace tomofield::evaluate {

base::Box whole_box(const base::Shape3& shape) { return {{}, {shape.nx, shape.ny, shape.nz}}; }

base::Box whole_box(const io::MrcReader& file) {
  return whole_box(base::Shape3{file.header().nx, file.header().ny, file.header().nz});
}

bool lies_within(const base::Box& box, const base::Box& outer) {
  for (std::size_t axis = 0; axis < 3; ++axis) {
    if (box.begin[axis] < outer.begin[axis] || box.end[axis] > outer.end[axis] ||
        box.begin[axis] >= box.end[axis])
      return false;
  }
  return true;
}

std::string to_text(const base::Box& box) {
  return fmt::format("{},{},{},{},{},{}", box.begin[0], box.begin[1], box.begin[2], box.end[0],
                     box.end[1], box.end[2]);
}

base::Volume read_box(const io::MrcReader& file, const base::Box& box) {
  base::require_memory(box.shape().voxels() * sizeof(float),
                       fmt::format("'{}' in memory", file.path().string()).c_str(),
                       "bin it, or cut a part out of it");
  base::Volume volume(box.shape(), io::cubic_voxel_size_A(file.header(), file.path()));
  io::warn_of_mode(file.header(), file.path().string());
  const base::Shape3& shape = volume.shape;
  std::vector<float> rows(static_cast<std::size_t>(file.header().nx * shape.ny));
  for (std::int64_t z = 0; z < shape.nz; ++z) {
    file.read_rows(box.begin[2] + z, box.begin[1], shape.ny, rows);
    for (std::int64_t y = 0; y < shape.ny; ++y) {
      const auto from = rows.begin() + y * file.header().nx + box.begin[0];
      std::copy(from, from + shape.nx, &volume.at(0, y, z));
    }
  }
  return volume;
}

void require_numbers(const base::Volume& volume, const std::filesystem::path& path) {
  const auto count =
      std::ranges::count_if(volume.data, [](float value) { return !std::isfinite(value); });
  if (count == 0) return;
  throw Error(
      fmt::format("'{}' has {} voxels that are NaN or infinite: correct it", path.string(), count));
}

base::Volume read_volume(const std::filesystem::path& path) {
  const io::MrcReader file(path);
  return read_box(file, whole_box(file));
}

}  // namespace tomofield::evaluate
