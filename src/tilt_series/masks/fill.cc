#include "tilt_series/masks/fill.h"

#include <algorithm>
#include <cmath>
#include <vector>

#include "tilt_series/masks/constant_fill.h"
#include "tilt_series/masks/noise_fill.h"
#include "tilt_series/masks/straight_fill.h"
#include "tilt_series/masks/taper.h"

namespace tomofield::tilt_series {
namespace {

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
  return {along_x, along_y, centre + side.offset_px + side.blur_px};
}

void mask_beyond_sides(const std::vector<FillSide>& sides, MaskedImage* image) {
  if (sides.empty()) return;
  std::vector<HalfPlane> planes;
  for (const FillSide& side : sides) planes.push_back(beyond(side, *image));
  for (std::int64_t y = 0; y < image->height; ++y) {
    for (std::int64_t x = 0; x < image->width; ++x) {
      const bool is_fill = std::any_of(planes.begin(), planes.end(), [&](const HalfPlane& plane) {
        return static_cast<double>(x) * plane.along_x + static_cast<double>(y) * plane.along_y <
               plane.offset;
      });
      if (is_fill) image->valid[image->index(x, y)] = 0;
    }
  }
}

void mask_rim(MaskedImage* image) {
  for (std::int64_t y = 0; y < image->height; ++y) {
    for (std::int64_t x = 0; x < image->width; ++x) {
      const bool is_rim = std::min({x, y, image->width - 1 - x, image->height - 1 - y}) < kRim_px;
      if (is_rim) image->valid[image->index(x, y)] = 0;
    }
  }
}

/// Marks what fades into the image from the pixels that were marked since `before`.
void mask_taper_of_fill(const std::vector<std::uint8_t>& before, MaskedImage* image) {
  std::vector<std::uint8_t> is_fill(before.size());
  double sum = 0.0, count = 0.0;
  for (std::size_t i = 0; i < before.size(); ++i) {
    is_fill[i] = before[i] && !image->valid[i];
    if (!is_fill[i]) continue;
    sum += image->values[i];
    count += 1.0;
  }
  if (count > 0.0) mask_taper(is_fill, sum / count, image);
}

}  // namespace

std::int64_t mask_fill(Contrast contrast, MaskedImage* image) {
  const std::vector<std::uint8_t> before = image->valid;
  const std::vector<FillSide> flat_sides = find_straight_fill(contrast, *image);
  mask_constant_fill(contrast, image);
  mask_beyond_sides(flat_sides, image);
  mask_taper_of_fill(before, image);
  if (!flat_sides.empty()) mask_rim(image);
  if (image->valid == before) mask_beyond_sides(find_noise_fill(*image), image);
  std::int64_t num_marked = 0;
  for (std::size_t i = 0; i < before.size(); ++i) {
    if (!before[i] || image->valid[i]) continue;
    image->values[i] = 0.0f;
    ++num_marked;
  }
  return num_marked;
}

}  // namespace tomofield::tilt_series
