#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

namespace tomofield::base {

/// Sizes of a volume in voxels; x is the fastest axis in memory and in files.
struct Shape3 {
  std::int64_t nx = 0;
  std::int64_t ny = 0;
  std::int64_t nz = 0;
  std::size_t voxels() const { return static_cast<std::size_t>(nx * ny * nz); }
  bool operator==(const Shape3&) const = default;
};

/// A volume [z, y, x] in memory. It serves test data, phantoms and metrics; large tomograms are
/// streamed instead.
struct Volume {
  Shape3 shape;
  double voxel_size_A = 1.0;
  std::vector<float> data;

  Volume() = default;
  explicit Volume(Shape3 s, double size_A = 1.0)
      : shape(s), voxel_size_A(size_A), data(s.voxels()) {}
  std::size_t index(std::int64_t x, std::int64_t y, std::int64_t z) const {
    return static_cast<std::size_t>((z * shape.ny + y) * shape.nx + x);
  }
  float& at(std::int64_t x, std::int64_t y, std::int64_t z) { return data[index(x, y, z)]; }
  float at(std::int64_t x, std::int64_t y, std::int64_t z) const { return data[index(x, y, z)]; }
};

}  // namespace tomofield::base
