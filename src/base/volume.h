#pragma once

#include <array>
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

/// A box of voxels, from `begin` up to but without `end`. Indices are x, y, z and count from zero.
struct Box {
  std::array<std::int64_t, 3> begin{};
  std::array<std::int64_t, 3> end{};
  Shape3 shape() const { return {end[0] - begin[0], end[1] - begin[1], end[2] - begin[2]}; }
  bool operator==(const Box&) const = default;
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
