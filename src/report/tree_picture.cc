#include "report/tree_picture.h"

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "field/sample_box.h"
#include "io/png.h"
#include "report/grey_scale.h"

namespace tomofield::report {
namespace {

using Colour = std::array<std::uint8_t, 3>;
constexpr Colour kBorder{255, 140, 0};

// A picture of the region of interest, `zoom` picture pixels a pixel.
class Canvas {
 public:
  Canvas(const geometry::Roi& roi, std::int64_t zoom)
      : roi_(roi),
        zoom_(zoom),
        width_(roi.width() * zoom),
        height_(roi.height() * zoom),
        pixels_(static_cast<std::size_t>(3 * width_ * height_)) {}

  /// Rectangle of picture pixels [x0, x1) × [y0, y1), y upwards, cut to the canvas.
  void fill(std::int64_t x0, std::int64_t y0, std::int64_t x1, std::int64_t y1,
            const Colour& colour) {
    for (std::int64_t y = std::max<std::int64_t>(y0, 0); y < std::min(y1, height_); ++y) {
      for (std::int64_t x = std::max<std::int64_t>(x0, 0); x < std::min(x1, width_); ++x)
        std::ranges::copy(colour, pixels_.begin() + 3 * ((height_ - 1 - y) * width_ + x));
    }
  }

  void draw_border(const field::Square& square) {
    const std::int64_t x0 = (square.x0 - roi_.x0) * zoom_, y0 = (square.y0 - roi_.y0) * zoom_;
    const std::int64_t size = square.size * zoom_;
    fill(x0, y0, x0 + size, y0 + 1, kBorder);
    fill(x0, y0, x0 + 1, y0 + size, kBorder);
  }

  void write(const std::filesystem::path& path) const {
    io::write_png_rgb(path, width_, height_, pixels_);
  }

 private:
  geometry::Roi roi_;
  std::int64_t zoom_, width_, height_;
  std::vector<std::uint8_t> pixels_;
};

// One voxel a pixel, halfway up: [y, x].
std::vector<float> central_slice(const field::Model& model) {
  const geometry::Roi& roi = model.roi;
  field::Box box;
  box.size = {roi.width(), roi.height(), 1};
  box.centre_px = {0.5 * static_cast<double>(roi.x0 + roi.x1),
                   0.5 * static_cast<double>(roi.y0 + roi.y1), 0.5 * model.field->thickness()};
  std::vector<float> slice = field::sample_box(*model.field, box);
  for (float& value : slice) value *= static_cast<float>(model.output_scale());
  return slice;
}

}  // namespace

void write_tree_picture(const field::Model& model, const std::filesystem::path& path) {
  const geometry::Roi& roi = model.roi;
  const std::vector<float> slice = central_slice(model);
  const GreyScale scale(slice);
  const std::int64_t zoom = picture_zoom(roi.width(), roi.width());
  Canvas canvas(roi, zoom);
  for (std::int64_t y = 0; y < roi.height(); ++y) {
    for (std::int64_t x = 0; x < roi.width(); ++x) {
      const std::uint8_t grey =
          scale.grey(static_cast<double>(slice[static_cast<std::size_t>(y * roi.width() + x)]));
      canvas.fill(x * zoom, y * zoom, (x + 1) * zoom, (y + 1) * zoom, {grey, grey, grey});
    }
  }
  const field::Quadtree& tree = model.field->tree();
  for (int leaf = 0; leaf < tree.num_leaves(); ++leaf) canvas.draw_border(tree.leaf(leaf).square);
  canvas.write(path);
}

}  // namespace tomofield::report
