#pragma once

#include <cstddef>
#include <cstdint>
#include <span>

namespace tomofield::base {

/// XXH64 with seed 0 (Collet, xxHash specification 0.1.1): a checksum as fast as
/// memory, with implementations in every language. Bytes are read as this
/// machine orders them, so the machine must be little-endian.
std::uint64_t xxhash64(std::span<const std::byte> bytes);

}  // namespace tomofield::base
