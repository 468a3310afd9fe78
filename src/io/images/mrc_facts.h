#pragma once

#include <array>
#include <cstdint>
#include <filesystem>
#include <optional>

#include "io/images/mrc.h"

namespace tomofield::io {

/// What an MRC file has and its MrcHeader does not say.
struct MrcFacts {
  std::array<double, 3> voxel_size_A{};  ///< as the header states it, even if it cannot be
  std::int64_t sections_beyond = 0;      ///< whole sections after the last one that it states
};

/// Returns the facts of a file that was read with this header. Returns nothing if it is no MRC file
/// of this header, but a TIFF file, a table that names images, or the name of a stack in memory.
std::optional<MrcFacts> find_mrc_facts(const std::filesystem::path& path, const MrcHeader& header);

}  // namespace tomofield::io
