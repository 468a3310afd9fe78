#include "view/viewed_volume.h"

#include <cmath>
#include <limits>

#include "io/hdf5/hdf5_reader.h"

namespace tomofield::view {

std::vector<float> ViewedVolume::sample(const Plane& plane) const {
  std::vector<float> values = sample_voxels(plane);
  auto value = values.begin();
  for (std::int64_t row = 0; row < plane.height; ++row) {
    for (std::int64_t column = 0; column < plane.width; ++column, ++value) {
      const Point at =
          plane.position(static_cast<double>(column) + 0.5, static_cast<double>(row) + 0.5);
      for (std::size_t axis = 0; axis < 3; ++axis)
        if (at[axis] < 0 || at[axis] >= static_cast<double>(size_[axis]))
          *value = std::numeric_limits<float>::quiet_NaN();
    }
  }
  return values;
}

std::unique_ptr<ViewedVolume> open_volume(const std::filesystem::path& path) {
  return io::has_hdf5_signature(path) ? open_model(path) : open_mrc(path);
}

}  // namespace tomofield::view
