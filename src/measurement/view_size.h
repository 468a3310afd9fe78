#pragma once

#include <cstdint>

namespace tomofield::measurement {

/// Throws Error for views in which nothing can be seen: with fewer than 8 pixels along a side.
void require_pixels(std::int64_t width, std::int64_t height);

}  // namespace tomofield::measurement
