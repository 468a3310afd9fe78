#include "baseline/classical/bridge_gaps.h"

#include "kernels/lanes.h"

namespace tomofield::baseline {

using kernels::kLanes;

void bridge_gaps(const std::uint16_t* mask, std::int64_t width, float* rays) {
  for (int lane = 0; lane < kLanes; ++lane) {
    const auto ray = [&](std::int64_t x) -> float& { return rays[x * kLanes + lane]; };
    std::int64_t last = -1;  // the last ray that counts
    for (std::int64_t x = 0; x <= width; ++x) {
      const bool is_end = x == width;
      if (!is_end && (mask[x] >> lane & 1) == 0) continue;
      const bool has_both = last >= 0 && !is_end;
      const float slope = has_both ? (ray(x) - ray(last)) / static_cast<float>(x - last) : 0.0f;
      for (std::int64_t i = last + 1; i < x; ++i)
        ray(i) = has_both ? ray(last) + slope * static_cast<float>(i - last) : 0.0f;
      last = x;
    }
  }
}

}  // namespace tomofield::baseline
