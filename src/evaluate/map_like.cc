#include "evaluate/map_like.h"

#include <fmt/format.h>

#include "tomofield/version.h"

namespace tomofield::evaluate {

io::MrcSpec map_like(const io::MrcHeader& header, const std::string& what) {
  return {.nx = header.nx,
          .ny = header.ny,
          .nz = header.nz,
          .mode = io::MrcMode::kFloat32,
          .voxel_size_A = header.voxel_size_A,
          .origin_A = header.origin_A,
          .labels = {fmt::format("tomofield {}: {}", library_version(), what)}};
}

}  // namespace tomofield::evaluate
