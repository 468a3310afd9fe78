#pragma once

#include <array>
#include <cstdint>
#include <map>
#include <string>

namespace tomofield::view {

using Point = std::array<double, 3>;  ///< x, y, z

/// The most pixels along a side of a plane that can be asked for.
inline constexpr std::int64_t kLargestSide_px = 4096;

/// A rectangle of pixels anywhere in a volume. Lengths are in the unit of the volume (Å, or
/// voxels); positions count from its lower corner.
struct Plane {
  Point centre{};       ///< of the rectangle
  Point right{}, up{};  ///< directions of a row and of a column: of length 1, at right angles
  std::int64_t width = 0, height = 0;
  double step = 0;  ///< side of a pixel

  /// Returns the position of a point that is counted in pixels from the lower left corner.
  Point position(double column, double row) const;
};

/// The parameters of a request by their names.
using Parameters = std::map<std::string, std::string>;

/// Reads the plane that a request asks for: "center", "right" and "up" (x,y,z), "width", "height"
/// and "step". Throws Error with the name of a parameter that is absent, is no number or is out of
/// range, and if the directions do not have length 1 or are not at right angles.
Plane requested_plane(const Parameters& parameters);

/// Reads a whole number from 0 to `largest`. Throws Error in the same way.
std::int64_t requested_number(const Parameters& parameters, const char* name, std::int64_t largest);

}  // namespace tomofield::view
