#pragma once

#include <cstdint>

namespace tomofield::baseline {

/// Replaces rays [x, lane] that do not count (mask [x], bit = lane) by a straight line between the
/// nearest ones that do in their row. Those at a row's ends, with none on one side, become 0.
void bridge_gaps(const std::uint16_t* mask, std::int64_t width, float* rays);

}  // namespace tomofield::baseline
