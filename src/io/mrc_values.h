#pragma once

#include <cstddef>
#include <span>

#include "io/mrc.h"

namespace tomofield::io {

/// Converts the bytes of a file to floats. `raw` holds out.size() values of the header's mode and
/// byte order; they may be byte-swapped in place.
void decode_values(const MrcHeader& header, std::span<std::byte> raw, std::span<float> out);

/// Converts floats to the bytes of a little-endian file. Integers round to the nearest and are
/// clamped to their range, half floats to ±65504; NaN becomes the integer 0. `stored` receives the
/// values that a reader will find.
void encode_values(MrcMode mode, std::span<const float> values, std::span<std::byte> raw,
                   std::span<float> stored);

}  // namespace tomofield::io
