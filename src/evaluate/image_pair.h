#pragma once

#include <array>
#include <cstdint>
#include <vector>

namespace tomofield::evaluate {

/// An image [y, x]; NaN where nothing was measured.
struct Image {
  std::int64_t width = 0, height = 0;
  std::vector<float> values;
};

/// Returns the means over blocks of factor × factor pixels; those on the last columns and rows may
/// be smaller. A block counts if at least half of its pixels do.
Image reduced(const Image& image, std::int64_t factor);

/// Returns the mean of each column; NaN where the column has no measurement.
std::vector<double> column_means(const Image& image);

/// Returns the image less the mean of each column.
Image without_column_means(const Image& image);

/// Returns Pearson's correlation over the pixels that both images have, which are of one size; 0 if
/// there are none or if one of them is constant.
double correlation(const Image& one, const Image& other);

/// Returns the largest correlation of two images of one size that is found by moving one of them by
/// up to `reach` pixels along x and y.
double shifted_correlation(const Image& one, const Image& other, std::int64_t reach);

/// Returns the correlation of the differences of two images between pixels that are `distance`
/// apart along x and along y. It is 0 along an axis without such pixels that both images have, and
/// for a constant difference.
std::array<double, 2> difference_correlation(const Image& one, const Image& other,
                                             std::int64_t distance);

/// Returns how far, along x and y in pixels, the content of `moved` lies from that of `reference`:
/// the maximum of their cross-correlation within a quarter of the image, between pixels by a
/// parabola. Details larger than an eighth of the image do not count. Both have one size.
std::array<double, 2> displacement(const Image& reference, const Image& moved);

}  // namespace tomofield::evaluate
