#pragma once

#include <cstdint>
#include <string_view>

namespace tomofield::io {

/// Returns Bob Jenkins' hash lookup3 (hashlittle(), 2006, with 0 to begin with), with which HDF5
/// protects its metadata.
std::uint32_t lookup3(std::string_view bytes);

}  // namespace tomofield::io
