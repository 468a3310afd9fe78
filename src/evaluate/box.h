#pragma once

#include <filesystem>
#include <string>

#include "base/volume.h"
#include "io/images/mrc.h"

namespace tomofield::evaluate {

/// Returns the box that holds all voxels.
base::Box whole_box(const base::Shape3& shape);
base::Box whole_box(const io::MrcReader& file);

/// Returns true if `box` has voxels and all of them lie in `outer`.
bool lies_within(const base::Box& box, const base::Box& outer);

/// Returns "x0,y0,z0,x1,y1,z1", the form of a box on the command line.
std::string to_text(const base::Box& box);

/// Throws Error if a voxel of a file's volume is NaN or infinite.
void require_numbers(const base::Volume& volume, const std::filesystem::path& path);

/// Reads the voxels of a box that lies within the file. No other voxel is held in memory. Warns if
/// the header states values that the file's numbers cannot be.
base::Volume read_box(const io::MrcReader& file, const base::Box& box);
/// Reads all voxels of an MRC file. Throws Error if the file cannot be read.
base::Volume read_volume(const std::filesystem::path& path);

}  // namespace tomofield::evaluate
