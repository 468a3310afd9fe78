#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <vector>

namespace tomofield::tilt_series {

/// Adds up the elements at most `reach` columns and rows away from each element of an image [y, x].
template <typename T>
std::vector<float> box_sums(const std::vector<T>& image, std::int64_t width, std::int64_t reach) {
  const std::int64_t height = std::ssize(image) / width;
  std::vector<float> of_rows(image.size()), sums(image.size());
  for (std::int64_t y = 0; y < height; ++y) {
    const T* row = image.data() + y * width;
    double sum = 0.0;
    for (std::int64_t x = 0; x < std::min(reach, width); ++x) sum += row[x];
    for (std::int64_t x = 0; x < width; ++x) {
      if (x + reach < width) sum += row[x + reach];
      if (x - reach > 0) sum -= row[x - reach - 1];
      of_rows[static_cast<std::size_t>(y * width + x)] = static_cast<float>(sum);
    }
  }
  std::vector<double> columns(static_cast<std::size_t>(width));
  const auto add_row = [&](std::int64_t y, double sign) {
    if (y < 0 || y >= height) return;
    const float* row = of_rows.data() + y * width;
    for (std::size_t x = 0; x < columns.size(); ++x) columns[x] += sign * row[x];
  };
  for (std::int64_t y = 0; y < std::min(reach, height); ++y) add_row(y, 1.0);
  for (std::int64_t y = 0; y < height; ++y) {
    add_row(y + reach, 1.0);
    add_row(y - reach - 1, -1.0);
    std::copy(columns.begin(), columns.end(), sums.begin() + y * width);
  }
  return sums;
}

}  // namespace tomofield::tilt_series
