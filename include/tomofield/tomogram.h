#pragma once

#include <array>
#include <cstdint>
#include <vector>

namespace tomofield {

/// A volume in memory: [z, y, x] with x fastest.
struct Tomogram {
  std::array<std::int64_t, 3> size{};  ///< voxels in x, y, z
  double voxel_size_A = 1.0;
  std::array<double, 3> origin_A{};  ///< of its corner in the whole volume, x, y, z
  std::vector<float> values;
};

}  // namespace tomofield
