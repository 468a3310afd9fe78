#include "tilt_series/masks/flat_fill.h"

#include <algorithm>
#include <cmath>
#include <vector>

#include "tilt_series/masks/constant_fill.h"
#include "tilt_series/masks/straight_fill.h"

namespace tomofield::tilt_series {
namespace {

// Sides are found where 5 × 5 means stop being flat, 2 px before the fill ends,
// to about 1 px; 2 px of blur come on top.
constexpr double kEdge_px = 2.0 + 1.0 + 2.0;
constexpr std::int64_t kRim_px = 2;

/// The pixels with x·along_x + y·along_y < offset, where x and y count from the lower left pixel.
struct HalfPlane {
  double along_x = 0.0;
  double along_y = 0.0;
  double offset = 0.0;
};

HalfPlane beyond(const FillSide& side, const MaskedImage& image) {
  const double along_x = std::cos(side.angle_rad), along_y = std::sin(side.angle_rad);
  const double centre = 0.5 * (static_cast<double>(image.width - 1) * along_x +
                               static_cast<double>(image.height - 1) * along_y);
  return {along_x, along_y, centre + side.offset_px + kEdge_px};
}

std::int64_t mask_beyond_sides(const std::vector<FillSide>& sides, MaskedImage* image) {
  std::vector<HalfPlane> planes;
  for (const FillSide& side : sides) planes.push_back(beyond(side, *image));
  std::int64_t num_marked = 0;
  for (std::int64_t y = 0; y < image->height; ++y) {
    for (std::int64_t x = 0; x < image->width; ++x) {
      const bool is_rim = std::min({x, y, image->width - 1 - x, image->height - 1 - y}) < kRim_px;
      const bool is_fill = std::any_of(planes.begin(), planes.end(), [&](const HalfPlane& plane) {
        return static_cast<double>(x) * plane.along_x + static_cast<double>(y) * plane.along_y <
               plane.offset;
      });
      if (!is_rim && !is_fill) continue;
      const std::size_t at = image->index(x, y);
      num_marked += image->valid[at];
      image->valid[at] = 0;
      image->values[at] = 0.0f;
    }
  }
  return num_marked;
}

}  // namespace

std::int64_t mask_flat_fill(Contrast contrast, MaskedImage* image) {
  const std::vector<FillSide> sides = find_straight_fill(contrast, *image);
  const std::int64_t num_constant = mask_constant_fill(contrast, image);
  return sides.empty() ? num_constant : num_constant + mask_beyond_sides(sides, image);
}

}  // namespace tomofield::tilt_series
