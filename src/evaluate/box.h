#pragma once

#include <array>
#include <cstdint>
#include <filesystem>
#include <string>

#include "base/volume.h"
#include "io/mrc.h"

namespace tomofield::evaluate {

/// A box of voxels. Indices count from zero; `last` is excluded.
struct Box {
  std::array<std::int64_t, 3> first{};  ///< x, y, z
  std::array<std::int64_t, 3> last{};
  base::Shape3 shape() const {
    return {last[0] - first[0], last[1] - first[1], last[2] - first[2]};
  }
  bool operator==(const Box&) const = default;
};

/// Returns the box that holds all voxels.
Box whole_box(const base::Shape3& shape);
Box whole_box(const io::MrcReader& file);

/// Returns true if `box` has voxels and all of them lie in `outer`.
bool lies_within(const Box& box, const Box& outer);

/// Returns "x0,y0,z0,x1,y1,z1", the form of a box on the command line.
std::string to_text(const Box& box);

/// Reads the voxels of a box that lies within the file. No other voxel is held in memory.
base::Volume read_box(const io::MrcReader& file, const Box& box);
/// Reads all voxels of an MRC file. Throws Error if the file cannot be read.
base::Volume read_volume(const std::filesystem::path& path);

}  // namespace tomofield::evaluate
