#pragma once

#include <cmath>
#include <cstddef>
#include <cstdint>
#include <vector>

namespace tomofield::tilt_series {

/// One straight side of a rotated image. Pixels with x·cos(angle) + y·sin(angle) < offset are fill,
/// with x and y in pixels from the centre of the pixel grid.
struct FillSide {
  double angle_rad = 0.0;
  double offset_px = 0.0;
  double blur_px = 0.0;  ///< fill and image may be mixed so far beyond the offset
};

/// Places on a regular grid of an image's pixels.
struct SampleGrid {
  std::int64_t columns = 0;
  std::int64_t rows = 0;
  double step_px = 1.0;

  std::size_t size() const { return static_cast<std::size_t>(columns * rows); }
  /// Returns the number of strips, one step wide, that cover the grid in any direction.
  std::int64_t num_strips() const {
    return static_cast<std::int64_t>(std::hypot(columns, rows)) + 3;
  }
  /// Returns where the fill ends if the first `depth` strips hold it, as FillSide::offset_px.
  double offset_px(std::int64_t depth) const {
    return (static_cast<double>(depth) - 0.5 * static_cast<double>(num_strips())) * step_px;
  }
};

/// Calls visit(index of the sample, its strip). Strips are one step wide; the first is at the far
/// end of the direction opposite to `angle_rad`.
template <typename Visit>
void visit_strips(const SampleGrid& grid, double angle_rad, const Visit& visit) {
  const auto along_x = static_cast<float>(std::cos(angle_rad));
  const double middle = 0.5 * static_cast<double>(grid.num_strips());
  const double centre_column = 0.5 * static_cast<double>(grid.columns - 1);
  const double centre_row = 0.5 * static_cast<double>(grid.rows - 1);
  std::size_t index = 0;
  for (std::int64_t row = 0; row < grid.rows; ++row) {
    const auto start =
        static_cast<float>(middle + (static_cast<double>(row) - centre_row) * std::sin(angle_rad) -
                           centre_column * std::cos(angle_rad));
    for (std::int64_t column = 0; column < grid.columns; ++column, ++index) {
      visit(index, static_cast<std::size_t>(start + along_x * static_cast<float>(column)));
    }
  }
}

/// A rectangle that an image may fill, as votes have it: a sample votes for fill with a positive
/// number, and against it with a negative one.
struct FillFrame {
  double rotation_rad = 0.0;
  std::int64_t votes = 0;  ///< sum of all votes beyond the four sides
};

/// Returns the rotation, at most 15° either way, with the largest sum of votes beyond the sides of
/// the best rectangle; the sum is 0 if there is none above 0.
FillFrame best_frame(const SampleGrid& grid, const std::vector<int>& votes);

/// Returns the number of strips, from the far end of a direction, with the largest sum of votes.
std::int64_t depth_of_fill(const SampleGrid& grid, const std::vector<int>& votes, double angle_rad);

}  // namespace tomofield::tilt_series
