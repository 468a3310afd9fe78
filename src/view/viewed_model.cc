// A model as a volume that planes can be taken from.

#include <algorithm>
#include <cmath>

#include "field/sampling/sample_box.h"
#include "output/model_file.h"
#include "output/sample_model.h"
#include "output/volume.h"
#include "view/viewed_volume.h"

namespace tomofield::view {
namespace {

// Returns the axis that a direction runs along, or −1.
int axis_of(const Point& direction) {
  for (int axis = 0; axis < 3; ++axis) {
    Point unit{};
    unit[static_cast<std::size_t>(axis)] = 1;
    if (direction == unit) return axis;
  }
  return -1;
}

class ViewedModel : public ViewedVolume {
 public:
  explicit ViewedModel(const std::filesystem::path& path)
      : model_(output::load_to_sample(path)), region_(output::region_box(model_, 1.0)) {
    title_ = path.filename().string();
    note_ = "model: every zoom is evaluated from the fitted field";
    size_ = region_.size;
    voxel_size_A_ = model_.pixel_size_A;
    contrast_ = report::contrast_of(middle_values());
  }

 private:
  std::vector<float> sample_voxels(const Plane& plane) const override {
    std::vector<float> values =
        is_aligned(plane) ? aligned_values(plane) : point_values(plane, points_along_side(plane));
    const auto scale = static_cast<float>(model_.output_scale());
    for (float& value : values) value = scale * value + 0.0f;  // no −0
    return values;
  }

  std::int64_t points_per_pixel(const Plane& plane) const override {
    const auto points = static_cast<std::int64_t>(std::ceil(plane.step));
    return is_aligned(plane) ? points * points * points
                             : points_along_side(plane) * points_along_side(plane);
  }

  // Says whether a plane can be sampled the fast way. Pixels that are larger than all that a page
  // shows are no means over their depth, which would take without end.
  bool is_aligned(const Plane& plane) const {
    constexpr double kLargestMean_px = 64;
    return plane.step <= kLargestMean_px && region_.is_aligned() && axis_of(plane.right) >= 0 &&
           axis_of(plane.up) >= 0;
  }

  // Returns 2 for pixels that are larger than those of the fit.
  static std::int64_t points_along_side(const Plane& plane) { return plane.step > 1 ? 2 : 1; }

  // Samples a box of one voxel's thickness, the fast way.
  std::vector<float> aligned_values(const Plane& plane) const {
    const int across = axis_of(plane.right), up = axis_of(plane.up);
    field::OrientedBox box{
        .centre_px = region_.position(plane.centre), .size = {1, 1, 1}, .voxel_px = plane.step};
    box.size[static_cast<std::size_t>(across)] = plane.width;
    box.size[static_cast<std::size_t>(up)] = plane.height;
    std::vector<float> values = output::sample_box(model_, box);
    return across < up ? values : transposed(values, plane);
  }

  // Turns [column, row] into [row, column].
  static std::vector<float> transposed(const std::vector<float>& values, const Plane& plane) {
    std::vector<float> turned;
    turned.reserve(values.size());
    for (std::int64_t row = 0; row < plane.height; ++row)
      for (std::int64_t column = 0; column < plane.width; ++column)
        turned.push_back(values[static_cast<std::size_t>(column * plane.height + row)]);
    return turned;
  }

  // Evaluates the field and returns the means of side × side points of each pixel.
  std::vector<float> point_values(const Plane& plane, std::int64_t side) const {
    const auto of_pixel = static_cast<std::size_t>(side * side);
    const auto num_pixels = static_cast<std::size_t>(plane.height * plane.width);
    std::vector<field::Point> points;
    points.reserve(num_pixels * of_pixel);
    const auto place = [side](std::int64_t pixel, std::int64_t i) {
      return static_cast<double>(pixel) +
             (static_cast<double>(i) + 0.5) / static_cast<double>(side);
    };
    for (std::int64_t row = 0; row < plane.height; ++row)
      for (std::int64_t column = 0; column < plane.width; ++column)
        for (std::int64_t i = 0; i < side * side; ++i)
          points.push_back(
              region_.position(plane.position(place(column, i % side), place(row, i / side))));
    const std::vector<float> densities = output::sample_points(model_, points);
    std::vector<float> values(num_pixels);
    for (std::size_t i = 0; i < densities.size(); ++i)
      values[i / of_pixel] += densities[i] / static_cast<float>(of_pixel);
    return values;
  }

  // Returns the middle of the region in at most 128 voxels a side, in the units of the file.
  std::vector<float> middle_values() const {
    constexpr double kSide = 128;
    field::OrientedBox box = region_;
    box.size = report::middle_size(region_.size);
    const auto longest = static_cast<double>(*std::ranges::max_element(box.size));
    box.voxel_px = std::max(1.0, longest / kSide);
    for (std::int64_t& size : box.size)
      size = std::max<std::int64_t>(1, std::lround(static_cast<double>(size) / box.voxel_px));
    std::vector<float> values = output::sample_box(model_, box);
    for (float& value : values) value *= static_cast<float>(model_.output_scale());
    return values;
  }

  output::Model model_;
  field::OrientedBox region_;
};

}  // namespace

std::unique_ptr<ViewedVolume> open_model(const std::filesystem::path& path) {
  return std::make_unique<ViewedModel>(path);
}

}  // namespace tomofield::view
