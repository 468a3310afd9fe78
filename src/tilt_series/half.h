#pragma once

#include <array>
#include <filesystem>

namespace tomofield::tilt_series {

/// The two halves of a measurement: of the frames of each view, or of the tilts.
enum class Half { kEven, kOdd };
inline constexpr std::array kBothHalves{Half::kEven, Half::kOdd};

/// The stacks of both halves of the frames.
struct HalfPaths {
  std::filesystem::path even, odd;
};

}  // namespace tomofield::tilt_series
