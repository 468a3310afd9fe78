#pragma once

#include <string>

#include "io/images/mrc.h"

namespace tomofield::evaluate {

/// Returns a float volume with the size, the voxel size and the origin of another one.
io::MrcSpec map_like(const io::MrcHeader& header, const std::string& what);

}  // namespace tomofield::evaluate
