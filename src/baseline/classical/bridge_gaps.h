#pragma once

#include <cstdint>

namespace tomofield::baseline {

/// Replaces the rays [x, lane] that do not count (mask [x], a bit a lane) by a straight line
/// between the nearest ones in their row that count. Rays at the end of a row, with none that
/// counts on one side, become 0.
void bridge_gaps(const std::uint16_t* mask, std::int64_t width, float* rays);

}  // namespace tomofield::baseline
