#include "tilt_series/resampling/binning.h"

#include <algorithm>
#include <cmath>

#include "base/check.h"
#include "base/threads/parallel.h"

namespace tomofield::tilt_series {
namespace {

/// The input pixels of one output pixel along one axis, with the lengths shared.
struct Interval {
  std::int64_t first = 0;
  std::vector<double> lengths;
};

std::vector<Interval> make_intervals(std::int64_t size, double factor) {
  const std::int64_t num_out = reduced_size(size, factor);
  const double start = 0.5 * (static_cast<double>(size) - factor * static_cast<double>(num_out));
  std::vector<Interval> intervals(static_cast<std::size_t>(num_out));
  for (std::int64_t i = 0; i < num_out; ++i) {
    const double low = start + factor * static_cast<double>(i);
    const double high = low + factor;
    constexpr double kSliver = 1e-9;  // a share below it comes from rounding
    Interval& interval = intervals[static_cast<std::size_t>(i)];
    interval.first =
        std::max<std::int64_t>(0, static_cast<std::int64_t>(std::floor(low + kSliver)));
    for (auto p = interval.first; p < size && static_cast<double>(p) < high - kSliver; ++p) {
      const auto left = static_cast<double>(p);
      interval.lengths.push_back(std::min(high, left + 1.0) - std::max(low, left));
    }
  }
  return intervals;
}

}  // namespace

std::int64_t reduced_size(std::int64_t size, double factor) {
  return static_cast<std::int64_t>(std::floor(static_cast<double>(size) / factor + 1e-9));
}

MaskedImage reduce_image(const MaskedImage& image, double factor) {
  TOMOFIELD_CHECK(factor >= 1.0, "images are reduced, never enlarged");
  if (factor == 1.0) return image;
  const std::vector<Interval> columns = make_intervals(image.width, factor);
  const std::vector<Interval> rows = make_intervals(image.height, factor);
  MaskedImage out(static_cast<std::int64_t>(columns.size()),
                  static_cast<std::int64_t>(rows.size()));

  base::parallel_for("reduce image", std::ssize(rows), [&](std::int64_t row) {
    const auto y = static_cast<std::size_t>(row);
    std::vector<double> sums(columns.size()), areas(columns.size());
    for (std::size_t j = 0; j < rows[y].lengths.size(); ++j) {
      const std::size_t line = image.index(0, rows[y].first + static_cast<std::int64_t>(j));
      for (std::size_t x = 0; x < columns.size(); ++x) {
        const std::size_t first = line + static_cast<std::size_t>(columns[x].first);
        for (std::size_t i = 0; i < columns[x].lengths.size(); ++i) {
          if (!image.valid[first + i]) continue;
          const double area = columns[x].lengths[i] * rows[y].lengths[j];
          sums[x] += area * image.values[first + i];
          areas[x] += area;
        }
      }
    }
    const double enough = 0.5 * factor * factor * (1.0 - 1e-9);
    for (std::size_t x = 0; x < columns.size(); ++x) {
      const std::size_t at = y * columns.size() + x;
      out.valid[at] = areas[x] >= enough;
      out.values[at] = out.valid[at] ? static_cast<float>(sums[x] / areas[x]) : 0.0f;
    }
  });
  return out;
}

}  // namespace tomofield::tilt_series
