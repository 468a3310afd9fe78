#include "tilt_series/resampling/align_means.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <vector>

#include "base/check.h"
#include "base/threads/parallel.h"
#include "tilt_series/resampling/align_image.h"

namespace tomofield::tilt_series {
namespace {

/// The pixels (up to four) along one axis that a position takes its value from.
struct Taps {
  std::int64_t first = 0;
  int count = 0;
  std::array<double, 4> weights{};
};

/// `position` is in pixel centres: 0 is the centre of the first pixel.
Taps make_taps(double position, std::int64_t size) {
  // Rounding must not cost the outermost pixels of an image that is only shifted.
  constexpr double kRounding = 1e-6;
  const auto last = static_cast<double>(size - 1);
  if (!(position >= -kRounding && position <= last + kRounding)) return {};
  position = std::clamp(position, 0.0, last);
  const auto base = static_cast<std::int64_t>(position);
  const double t = position - static_cast<double>(base);
  if (t < kRounding) return {base, 1, {1.0}};
  if (t > 1.0 - kRounding) return {base + 1, 1, {1.0}};
  if (base == 0 || base + 2 >= size) return {base, 2, {1.0 - t, t}};
  const double t2 = t * t, t3 = t2 * t;
  return {base - 1,
          4,
          {0.5 * (-t3 + 2 * t2 - t), 0.5 * (3 * t3 - 5 * t2 + 2), 0.5 * (-3 * t3 + 4 * t2 + t),
           0.5 * (t3 - t2)}};
}

/// Sets pixel `at` of `out` from the taps; false if one of them is no measurement.
bool interpolate(const MaskedImage& raw, const Taps& x, const Taps& y, float* value) {
  if (x.count == 0 || y.count == 0) return false;
  double sum = 0.0;
  for (int j = 0; j < y.count; ++j) {
    const std::size_t line = raw.index(x.first, y.first + j);
    double row = 0.0;
    for (int i = 0; i < x.count; ++i) {
      const std::size_t at = line + static_cast<std::size_t>(i);
      if (!raw.valid[at]) return false;
      row += x.weights[static_cast<std::size_t>(i)] * raw.values[at];
    }
    sum += y.weights[static_cast<std::size_t>(j)] * row;
  }
  *value = static_cast<float>(sum);
  return true;
}

// Holds sums of measurements and their number at the places of an image.
struct Sums {
  std::vector<double> values;
  std::vector<int> counts;
};

// Returns the sums over each `bin` neighbours in a row of an image. The first one has only the
// first half of them inside, the last one only the last half.
Sums sums_along_rows(const MaskedImage& image, int bin) {
  const std::int64_t width = image.width, half = bin / 2;
  const auto size = static_cast<std::size_t>((width + 1) * image.height);
  Sums sums{std::vector<double>(size), std::vector<int>(size)};
  std::vector<double> before(static_cast<std::size_t>(width + 1));
  std::vector<int> counted(before.size());
  for (std::int64_t y = 0; y < image.height; ++y) {
    for (std::int64_t x = 0; x < width; ++x) {
      const std::size_t at = image.index(x, y), i = static_cast<std::size_t>(x);
      const bool counts = image.valid[at] != 0;
      before[i + 1] = before[i] + (counts ? static_cast<double>(image.values[at]) : 0.0);
      counted[i + 1] = counted[i] + (counts ? 1 : 0);
    }
    for (std::int64_t x = 0; x <= width; ++x) {
      const auto first = static_cast<std::size_t>(std::max<std::int64_t>(0, x - half));
      const auto end = static_cast<std::size_t>(std::min(width, x + half));
      const auto to = static_cast<std::size_t>(y * (width + 1) + x);
      sums.values[to] = before[end] - before[first];
      sums.counts[to] = counted[end] - counted[first];
    }
  }
  return sums;
}

// Returns the mean over bin × bin pixels around each corner of the pixels of an image.
MaskedImage running_means(const MaskedImage& image, int bin) {
  const Sums rows = sums_along_rows(image, bin);
  MaskedImage means(image.width + 1, image.height + 1);
  const auto width = static_cast<std::size_t>(means.width);
  Sums sums{std::vector<double>(width), std::vector<int>(width)};
  const auto add = [&](std::int64_t y, int sign) {
    if (y < 0 || y >= image.height) return;
    const std::size_t from = static_cast<std::size_t>(y) * width;
    for (std::size_t x = 0; x < width; ++x) {
      sums.values[x] += sign * rows.values[from + x];
      sums.counts[x] += sign * rows.counts[from + x];
    }
  };
  const std::int64_t half = bin / 2;
  for (std::int64_t y = 0; y < half - 1; ++y) add(y, 1);
  for (std::int64_t y = 0; y < means.height; ++y) {
    add(y + half - 1, 1);
    add(y - half - 1, -1);
    for (std::size_t x = 0; x < width; ++x) {
      const std::size_t at = means.index(static_cast<std::int64_t>(x), y);
      means.valid[at] = 2 * sums.counts[x] >= bin * bin;
      if (means.valid[at]) means.values[at] = static_cast<float>(sums.values[x] / sums.counts[x]);
    }
  }
  return means;
}

}  // namespace

MaskedImage align_means(const MaskedImage& raw, const geometry::RawFromAligned& transform,
                        std::int64_t width, std::int64_t height, std::int64_t first_row, int bin,
                        const std::optional<geometry::ViewWarp>& local) {
  TOMOFIELD_CHECK(bin > 0 && bin % 2 == 0, "squares around the corners of pixels");
  const MaskedImage means = running_means(raw, bin);
  const RawPlaces places(transform, raw.width, raw.height, local);
  const auto [centre_x, centre_y] = RawPlaces::centre_of(width, height);
  const double first_x = 0.5 * (bin - 1) - centre_x;  // the centre of the first wide pixel
  const double first_y = static_cast<double>(first_row) + 0.5 * (bin - 1) - centre_y;
  MaskedImage out((width + bin - 1) / bin, (height - first_row + bin - 1) / bin);
  base::parallel_for("align view", out.height, [&](std::int64_t y) {
    for (std::int64_t x = 0; x < out.width; ++x) {
      const auto [raw_x, raw_y] =
          places.of(first_x + bin * static_cast<double>(x), first_y + bin * static_cast<double>(y));
      const std::size_t at = out.index(x, y);
      // The first mean lies half a pixel before the first pixel.
      out.valid[at] = interpolate(means, make_taps(raw_x + 0.5, means.width),
                                  make_taps(raw_y + 0.5, means.height), &out.values[at]);
    }
  });
  return out;
}

}  // namespace tomofield::tilt_series
