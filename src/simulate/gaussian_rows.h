#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

namespace tomofield::simulate {

/// Indices from `first` up to but without `last`; none if last <= first.
struct IndexRange {
  std::int64_t first = 0;
  std::int64_t last = 0;
};

/// Returns the indices of `count` positions start, start + 1, … that lie within `reach` of
/// `center`.
inline IndexRange indices_near(double center, double reach, double start, std::int64_t count) {
  const double first = std::max(std::ceil(center - reach - start), 0.0);
  const double last = std::min(std::floor(center + reach - start), static_cast<double>(count - 1));
  if (first > last) return {};
  return {static_cast<std::int64_t>(first), static_cast<std::int64_t>(last) + 1};
}

/// A band of rows of an image or of a section, [values.size() / width, width]. Pixels lie one
/// apart.
struct PixelRows {
  double origin_x = 0.0;  ///< position of the centre of column 0
  double origin_y = 0.0;  ///< position of the centre of the image's row 0
  std::int64_t first_row = 0;
  std::int64_t width = 0;
  std::span<double> values;
};

/// Adds factor(x) · exp(−((x − center_x)² + (y − center_y)²) / 2σ²) to the pixels that are within
/// `reach` of the centre in x and in y. Any division of an image into bands gives the same bits.
template <typename Factor>
void add_gaussian(double center_x, double center_y, double sigma, double reach,
                  const Factor& factor, const PixelRows& rows) {
  const auto end_row = rows.first_row + static_cast<std::int64_t>(rows.values.size()) / rows.width;
  const IndexRange across = indices_near(center_x, reach, rows.origin_x, rows.width);
  const IndexRange along = indices_near(center_y, reach, rows.origin_y, end_row);
  if (across.last <= across.first || along.last <= rows.first_row) return;
  const auto gaussian = [&](double offset) {
    return std::exp(-0.5 * offset * offset / (sigma * sigma));
  };
  std::vector<double> profile;
  for (std::int64_t i = across.first; i < across.last; ++i) {
    const double x = rows.origin_x + static_cast<double>(i);
    profile.push_back(factor(x) * gaussian(x - center_x));
  }
  for (std::int64_t row = std::max(along.first, rows.first_row); row < along.last; ++row) {
    const double weight = gaussian(rows.origin_y + static_cast<double>(row) - center_y);
    double* out = rows.values.data() + (row - rows.first_row) * rows.width + across.first;
    for (std::size_t i = 0; i < profile.size(); ++i) out[i] += weight * profile[i];
  }
}

}  // namespace tomofield::simulate
