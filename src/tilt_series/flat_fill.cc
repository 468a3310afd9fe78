#include "tilt_series/flat_fill.h"

#include <algorithm>
#include <limits>
#include <vector>

namespace tomofield::tilt_series {
namespace {

constexpr std::size_t kFewestFillPixels = 64;

/// Regions of equal value, each pixel visited once.
class RegionFinder {
 public:
  explicit RegionFinder(const MaskedImage& image) : image_(image), seen_(image.valid.size()) {}

  /// The pixels 4-connected to `seed` that have its value; empty if it was visited before.
  const std::vector<std::size_t>& region_of(std::size_t seed) {
    region_.clear();
    visit(seed, image_.values[seed]);
    for (std::size_t next = 0; next < region_.size(); ++next) {
      const auto at = static_cast<std::int64_t>(region_[next]);
      const std::int64_t x = at % image_.width, y = at / image_.width;
      const float value = image_.values[region_[next]];
      if (x > 0) visit(region_[next] - 1, value);
      if (x + 1 < image_.width) visit(region_[next] + 1, value);
      if (y > 0) visit(image_.index(x, y - 1), value);
      if (y + 1 < image_.height) visit(image_.index(x, y + 1), value);
    }
    return region_;
  }

 private:
  void visit(std::size_t at, float value) {
    if (seen_[at] || !image_.valid[at] || image_.values[at] != value) return;
    seen_[at] = 1;
    region_.push_back(at);
  }

  const MaskedImage& image_;
  std::vector<std::uint8_t> seen_;
  std::vector<std::size_t> region_;
};

std::vector<std::size_t> edge_pixels(const MaskedImage& image) {
  std::vector<std::size_t> edge;
  for (std::int64_t x = 0; x < image.width; ++x) {
    edge.push_back(image.index(x, 0));
    edge.push_back(image.index(x, image.height - 1));
  }
  for (std::int64_t y = 0; y < image.height; ++y) {
    edge.push_back(image.index(0, y));
    edge.push_back(image.index(image.width - 1, y));
  }
  return edge;
}

float smallest_valid(const MaskedImage& image) {
  float smallest = std::numeric_limits<float>::infinity();
  for (std::size_t i = 0; i < image.values.size(); ++i) {
    if (image.valid[i]) smallest = std::min(smallest, image.values[i]);
  }
  return smallest;
}

}  // namespace

std::int64_t mask_flat_fill(Contrast contrast, MaskedImage* image) {
  const float empty = contrast == Contrast::kBright ? smallest_valid(*image)
                                                    : std::numeric_limits<float>::quiet_NaN();
  RegionFinder finder(*image);
  std::vector<std::size_t> fill;
  for (const std::size_t seed : edge_pixels(*image)) {
    if (image->values[seed] == empty) continue;
    const auto& region = finder.region_of(seed);
    if (region.size() >= kFewestFillPixels) fill.insert(fill.end(), region.begin(), region.end());
  }
  for (const std::size_t at : fill) {
    image->valid[at] = 0;
    image->values[at] = 0.0f;
  }
  return static_cast<std::int64_t>(fill.size());
}

}  // namespace tomofield::tilt_series
