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
    const int across = axis_of(plane.right), up = axis_of(plane.up);
    std::vector<float> values = region_.is_aligned() && across >= 0 && up >= 0
                                    ? aligned_values(plane, across, up)
                                    : point_values(plane);
    const auto scale = static_cast<float>(model_.output_scale());
    for (float& value : values) value = scale * value + 0.0f;  // no −0
    return values;
  }

  // Samples a box of one voxel's thickness, the fast way.
  std::vector<float> aligned_values(const Plane& plane, int across, int up) const {
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

  // Evaluates the field at the middle of every pixel, or at four points of one that is larger than
  // a pixel of the fit.
  std::vector<float> point_values(const Plane& plane) const {
    constexpr std::int64_t kPointsAtOnce = 4 << 20;
    const std::int64_t side = plane.step > 1 ? 2 : 1;
    const std::int64_t rows_at_once =
        std::max<std::int64_t>(1, kPointsAtOnce / (plane.width * side * side));
    std::vector<float> values;
    for (std::int64_t row = 0; row < plane.height; row += rows_at_once) {
      const std::vector<float> rows =
          values_of_rows(plane, row, std::min(row + rows_at_once, plane.height), side);
      values.insert(values.end(), rows.begin(), rows.end());
    }
    return values;
  }

  // Returns the means of side × side points of each pixel of some rows of a plane.
  std::vector<float> values_of_rows(const Plane& plane, std::int64_t first, std::int64_t end,
                                    std::int64_t side) const {
    const auto of_pixel = static_cast<std::size_t>(side * side);
    const auto num_pixels = static_cast<std::size_t>((end - first) * plane.width);
    std::vector<field::Point> points;
    points.reserve(num_pixels * of_pixel);
    const auto place = [side](std::int64_t pixel, std::int64_t i) {
      return static_cast<double>(pixel) +
             (static_cast<double>(i) + 0.5) / static_cast<double>(side);
    };
    for (std::int64_t row = first; row < end; ++row)
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
