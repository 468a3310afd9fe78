#pragma once

#include <cstddef>
#include <span>

#include "io/mrc.h"

namespace tomofield::io {

/// Converts the bytes of a file to floats. `raw` has out.size() values of the
/// header's mode and byte order and is changed on the way (swapped in place).
void decode_values(const MrcHeader& header, std::span<std::byte> raw, std::span<float> out);

/// Converts floats to the bytes of a little-endian file: integers round to the
/// nearest and stop at the ends of their range (NaN becomes 0), half floats at
/// ±65504. `stored` receives the values that a reader will find.
void encode_values(MrcMode mode, std::span<const float> values, std::span<std::byte> raw,
                   std::span<float> stored);

}  // namespace tomofield::io
