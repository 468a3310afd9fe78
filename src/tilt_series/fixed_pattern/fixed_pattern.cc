#include "tilt_series/fixed_pattern/fixed_pattern.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstdint>

namespace tomofield::tilt_series {
namespace {

double deviation(const std::vector<std::vector<float>>& views) {
  double sum = 0.0, squares = 0.0, count = 0.0;
  for (const std::vector<float>& lines : views) {
    for (const double value : lines) {
      sum += value;
      squares += value * value;
      count += 1.0;
    }
  }
  return count > 0.0 ? std::sqrt(std::max(0.0, squares / count - std::pow(sum / count, 2))) : 0.0;
}

}  // namespace

void FixedPattern::remove_from(std::size_t view, MaskedImage* image) const {
  for (const std::size_t at : pixels) {
    image->valid[at] = 0;
    image->values[at] = 0.0f;
  }
  if (columns.empty() && rows.empty()) return;
  for (std::int64_t y = 0; y < image->height; ++y) {
    const float of_row = rows.empty() ? 0.0f : rows[view][static_cast<std::size_t>(y)];
    for (std::int64_t x = 0; x < image->width; ++x) {
      const std::size_t at = image->index(x, y);
      if (!image->valid[at]) continue;
      const float of_column = columns.empty() ? 0.0f : columns[view][static_cast<std::size_t>(x)];
      image->values[at] -= of_column + of_row;
    }
  }
}

FixedPatternMetrics measure_pattern(const FixedPattern& pattern) {
  return {deviation(pattern.columns), deviation(pattern.rows), pattern.pixels.size()};
}

std::string describe_pattern(const FixedPatternMetrics& pattern) {
  std::vector<std::string> parts;
  if (pattern.column_deviation > 0.0)
    parts.push_back(
        fmt::format("columns with standard deviation {:.3g}", pattern.column_deviation));
  if (pattern.row_deviation > 0.0)
    parts.push_back(fmt::format("rows with standard deviation {:.3g}", pattern.row_deviation));
  if (pattern.num_pixels > 0) parts.push_back(fmt::format("{} single pixels", pattern.num_pixels));
  return fmt::format("{}", fmt::join(parts, ", "));
}

}  // namespace tomofield::tilt_series
