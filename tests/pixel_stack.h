#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <vector>

#include "io/images/mrc.h"

namespace tomofield::testing {

/// Returns the value at (x, y, section) of a stack.
using PixelFunction = std::function<float(std::int64_t, std::int64_t, std::int64_t)>;

inline std::filesystem::path write_stack(const std::filesystem::path& path, std::int64_t nx,
                                         std::int64_t ny, std::int64_t nz,
                                         const PixelFunction& value, double pixel_size_A = 2.5) {
  io::MrcSpec spec;
  spec.nx = nx;
  spec.ny = ny;
  spec.nz = nz;
  spec.is_volume = false;
  spec.voxel_size_A = {pixel_size_A, pixel_size_A, pixel_size_A};
  io::MrcWriter writer(path, spec);
  std::vector<float> section(static_cast<std::size_t>(nx * ny));
  for (std::int64_t z = 0; z < nz; ++z) {
    for (std::int64_t i = 0; i < nx * ny; ++i) {
      section[static_cast<std::size_t>(i)] = value(i % nx, i / nx, z);
    }
    writer.write_section(z, section);
  }
  writer.close();
  return path;
}

inline float some_value(std::int64_t x, std::int64_t y, std::int64_t z) {
  return static_cast<float>(100 + (x * 7 + y * 13 + z * 5) % 31);
}

}  // namespace tomofield::testing
