#include "tilt_series/masks/constant_fill.h"

#include <algorithm>
#include <limits>
#include <vector>

namespace tomofield::tilt_series {
namespace {

constexpr std::size_t kMinFillPixels = 64;

/// A region of equal values.
struct Region {
  std::vector<std::size_t> pixels;
  std::int64_t num_edges = 0;  ///< between its pixels and measured ones of other values

  /// Tells whether its outline is no longer than that of the area outside a rotated image, which
  /// is at least a line of pixels wide. Equal values of measurements, which have few levels,
  /// surround others everywhere.
  bool has_short_outline(const MaskedImage& image) const {
    return num_edges <= 3 * (image.width + image.height) && 4 * num_edges <= 5 * std::ssize(pixels);
  }
};

/// Finds regions of equal value and visits each pixel once.
class RegionFinder {
 public:
  explicit RegionFinder(const MaskedImage& image) : image_(image), seen_(image.valid.size()) {}

  /// Returns the pixels 4-connected to `seed` that have its value; none if it was visited before.
  const Region& region_of(std::size_t seed) {
    region_ = {};
    visit(seed, image_.values[seed]);
    for (std::size_t next = 0; next < region_.pixels.size(); ++next) {
      const std::size_t pixel = region_.pixels[next];
      const auto at = static_cast<std::int64_t>(pixel);
      const std::int64_t x = at % image_.width, y = at / image_.width;
      const float value = image_.values[pixel];
      if (x > 0) visit(pixel - 1, value);
      if (x + 1 < image_.width) visit(pixel + 1, value);
      if (y > 0) visit(image_.index(x, y - 1), value);
      if (y + 1 < image_.height) visit(image_.index(x, y + 1), value);
    }
    return region_;
  }

 private:
  void visit(std::size_t at, float value) {
    if (!image_.valid[at]) return;
    if (image_.values[at] != value) ++region_.num_edges;
    if (seen_[at] || image_.values[at] != value) return;
    seen_[at] = 1;
    region_.pixels.push_back(at);
  }

  const MaskedImage& image_;
  std::vector<std::uint8_t> seen_;
  Region region_;
};

/// Returns the value that space without specimen has where there is no noise.
float empty_value(Contrast contrast, const MaskedImage& image) {
  const bool is_bright = contrast == Contrast::kBright;
  float empty = std::numeric_limits<float>::infinity() * (is_bright ? 1.0f : -1.0f);
  for (std::size_t i = 0; i < image.values.size(); ++i) {
    if (!image.valid[i]) continue;
    empty = is_bright ? std::min(empty, image.values[i]) : std::max(empty, image.values[i]);
  }
  return empty;
}

/// A row or column of pixels.
struct Line {
  std::size_t start = 0;
  std::size_t stride = 1;
  std::int64_t count = 0;

  std::size_t at(std::int64_t i) const { return start + static_cast<std::size_t>(i) * stride; }
};

/// Returns the row or column `depth` pixels within one of the four edges.
Line line_within(const MaskedImage& image, bool is_row, bool from_end, std::int64_t depth) {
  const std::int64_t num_lines = is_row ? image.height : image.width;
  const std::int64_t position = from_end ? num_lines - 1 - depth : depth;
  if (is_row) return {image.index(0, position), 1, image.width};
  return {image.index(position, 0), static_cast<std::size_t>(image.width), image.height};
}

bool is_constant(const MaskedImage& image, const Line& line, float value) {
  for (std::int64_t i = 0; i < line.count; ++i) {
    if (image.values[line.at(i)] != value) return false;
  }
  return true;
}

/// Tells whether most neighbours in a line differ, as they do in measurements.
bool varies(const MaskedImage& image, const Line& line) {
  std::int64_t num_equal = 0;
  for (std::int64_t i = 1; i < line.count; ++i) {
    num_equal += image.values[line.at(i)] == image.values[line.at(i - 1)];
  }
  return 2 * num_equal < line.count;
}

/// Appends the lines at one edge that are all `value`, if the next one varies.
/// A specimen in empty space without noise has no such edge.
void append_strip(const MaskedImage& image, float value, bool is_rows, bool from_end,
                  std::vector<std::size_t>* fill) {
  const std::int64_t num_lines = is_rows ? image.height : image.width;
  std::int64_t depth = 0;
  while (depth < num_lines &&
         is_constant(image, line_within(image, is_rows, from_end, depth), value)) {
    ++depth;
  }
  if (depth == num_lines || !varies(image, line_within(image, is_rows, from_end, depth))) return;
  for (std::int64_t within = 0; within < depth; ++within) {
    const Line line = line_within(image, is_rows, from_end, within);
    for (std::int64_t i = 0; i < line.count; ++i) fill->push_back(line.at(i));
  }
}

}  // namespace

void mask_constant_fill(Contrast contrast, MaskedImage* image) {
  const float empty = empty_value(contrast, *image);
  RegionFinder finder(*image);
  std::vector<std::size_t> fill;
  for (const std::int64_t y : {std::int64_t{0}, image->height - 1}) {
    for (const std::int64_t x : {std::int64_t{0}, image->width - 1}) {
      const std::size_t corner = image->index(x, y);
      if (image->values[corner] == empty) continue;
      const Region& region = finder.region_of(corner);
      if (region.pixels.size() >= kMinFillPixels && region.has_short_outline(*image))
        fill.insert(fill.end(), region.pixels.begin(), region.pixels.end());
    }
  }
  for (const bool is_rows : {false, true}) {
    append_strip(*image, empty, is_rows, false, &fill);
    append_strip(*image, empty, is_rows, true, &fill);
  }
  for (const std::size_t at : fill) image->valid[at] = 0;
}

}  // namespace tomofield::tilt_series
