#include "view/viewed_volume.h"

#include <algorithm>
#include <limits>

#include "base/progress.h"
#include "io/hdf5/hdf5_reader.h"

namespace tomofield::view {

namespace {

// Points between two looks at the stop: 0.1 to 0.2 s of the largest ranks.
constexpr std::int64_t kPointsAtOnce = 1 << 19;

// A rectangle of pixels of a plane.
struct Pixels {
  std::int64_t first_column, end_column, first_row, end_row;
};

bool is_inside(const std::array<std::int64_t, 3>& size, const Point& at) {
  for (std::size_t axis = 0; axis < 3; ++axis)
    if (!(at[axis] >= 0 && at[axis] < static_cast<double>(size[axis]))) return false;
  return true;
}

Point middle_of_pixel(const Plane& plane, std::int64_t column, std::int64_t row) {
  return plane.position(static_cast<double>(column) + 0.5, static_cast<double>(row) + 0.5);
}

// Returns the smallest rectangle of pixels with all whose middle is inside of a volume.
Pixels pixels_inside(const Plane& plane, const std::array<std::int64_t, 3>& size) {
  Pixels found{plane.width, 0, plane.height, 0};
  for (std::int64_t row = 0; row < plane.height; ++row) {
    for (std::int64_t column = 0; column < plane.width; ++column) {
      if (!is_inside(size, middle_of_pixel(plane, column, row))) continue;
      found = {std::min(found.first_column, column), std::max(found.end_column, column + 1),
               std::min(found.first_row, row), std::max(found.end_row, row + 1)};
    }
  }
  return found;
}

Plane part_of(const Plane& plane, const Pixels& pixels) {
  Plane part = plane;
  part.centre = plane.position(0.5 * static_cast<double>(pixels.first_column + pixels.end_column),
                               0.5 * static_cast<double>(pixels.first_row + pixels.end_row));
  part.width = pixels.end_column - pixels.first_column;
  part.height = pixels.end_row - pixels.first_row;
  return part;
}

}  // namespace

std::vector<float> ViewedVolume::sample(const Plane& plane,
                                        const std::function<bool()>& must_stop) const {
  std::vector<float> values(static_cast<std::size_t>(plane.width * plane.height),
                            std::numeric_limits<float>::quiet_NaN());
  const Pixels inside = pixels_inside(plane, size_);
  const std::int64_t width = inside.end_column - inside.first_column;
  if (width <= 0) return values;
  const std::int64_t rows_at_once =
      std::max<std::int64_t>(1, kPointsAtOnce / (width * points_per_pixel(plane)));
  for (std::int64_t first = inside.first_row; first < inside.end_row; first += rows_at_once) {
    if (must_stop()) throw base::StopRequested();
    const std::int64_t end = std::min(first + rows_at_once, inside.end_row);
    const std::vector<float> part =
        sample_voxels(part_of(plane, {inside.first_column, inside.end_column, first, end}));
    auto value = part.begin();
    for (std::int64_t row = first; row < end; ++row)
      for (std::int64_t column = inside.first_column; column < inside.end_column; ++column, ++value)
        if (is_inside(size_, middle_of_pixel(plane, column, row)))
          values[static_cast<std::size_t>(row * plane.width + column)] = *value;
  }
  return values;
}

std::unique_ptr<ViewedVolume> open_volume(const std::filesystem::path& path) {
  return io::has_hdf5_signature(path) ? open_model(path) : open_mrc(path);
}

}  // namespace tomofield::view
