#include "tilt_series/resampling/align_image.h"

#include <algorithm>
#include <cmath>
#include <cstddef>

#include "base/threads/parallel.h"
#include "tilt_series/resampling/band_limited_image.h"

namespace tomofield::tilt_series {
namespace {

// Rounding must not cost the outermost pixels of an image that is only shifted.
constexpr double kRounding = 1e-6;

// The one or two pixels along one axis around a position; none outside of the image.
struct Neighbours {
  std::int64_t first = 0, count = 0;
};

// `position` is in pixel centres: 0 is the centre of the first pixel.
Neighbours neighbours_of(double position, std::int64_t size) {
  const auto last = static_cast<double>(size - 1);
  if (!(position >= -kRounding && position <= last + kRounding)) return {};
  const auto nearest = static_cast<std::int64_t>(std::floor(position + 0.5));
  if (std::abs(position - static_cast<double>(nearest)) < kRounding) return {nearest, 1};
  return {static_cast<std::int64_t>(position), 2};
}

bool are_measured(const MaskedImage& raw, const Neighbours& x, const Neighbours& y) {
  if (x.count == 0 || y.count == 0) return false;
  for (std::int64_t j = y.first; j < y.first + y.count; ++j)
    for (std::int64_t i = x.first; i < x.first + x.count; ++i)
      if (raw.valid[raw.index(i, j)] == kNoMeasurement) return false;
  return true;
}

// Says whether all aligned pixels lie on raw ones, of which `first` is the place of the first one.
bool is_whole_shift(const RawFromAligned& map, const RawPlaces::Vector& first) {
  const auto is_whole = [](double x) { return std::abs(x - std::round(x)) < kRounding; };
  return map.m11 == 1.0 && map.m12 == 0.0 && map.m21 == 0.0 && map.m22 == 1.0 &&
         is_whole(first[0]) && is_whole(first[1]);
}

}  // namespace

MaskedImage align_image(const MaskedImage& raw, const RawFromAligned& transform, std::int64_t width,
                        std::int64_t height, const std::optional<geometry::ViewWarp>& local) {
  const RawPlaces places(transform, raw.width, raw.height, local);
  const RawPlaces::Vector centre = RawPlaces::centre_of(width, height);
  std::optional<BandLimitedImage> between_pixels;
  if (local || !is_whole_shift(transform, places.of(-centre[0], -centre[1])))
    between_pixels.emplace(raw);
  MaskedImage out(width, height);
  base::parallel_for("align view", out.height, [&](std::int64_t y) {
    for (std::int64_t x = 0; x < out.width; ++x) {
      const auto [raw_x, raw_y] =
          places.of(static_cast<double>(x) - centre[0], static_cast<double>(y) - centre[1]);
      const Neighbours columns = neighbours_of(raw_x, raw.width);
      const Neighbours rows = neighbours_of(raw_y, raw.height);
      const std::size_t at = out.index(x, y);
      out.valid[at] = are_measured(raw, columns, rows) ? kMeasurement : kNoMeasurement;
      if (out.valid[at] == kNoMeasurement) continue;
      out.values[at] = between_pixels ? between_pixels->at(raw_x, raw_y)
                                      : raw.values[raw.index(columns.first, rows.first)];
    }
  });
  return out;
}

}  // namespace tomofield::tilt_series
