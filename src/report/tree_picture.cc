#include "report/tree_picture.h"

#include <cstddef>
#include <cstdint>
#include <vector>

#include "field/sampling/sample_box.h"
#include "report/canvas.h"
#include "report/grey_scale.h"
#include "tomofield/options.h"

namespace tomofield::report {
namespace {

constexpr Colour kBorder{255, 140, 0};

// Returns the slice at half the thickness, one voxel a pixel: [y, x].
std::vector<float> central_slice(const output::Model& model) {
  const Rectangle& roi = model.roi;
  field::OrientedBox box;
  box.size = {roi.width(), roi.height(), 1};
  box.centre_px = {0.5 * static_cast<double>(roi.x0 + roi.x1),
                   0.5 * static_cast<double>(roi.y0 + roi.y1), 0.5 * model.field->thickness()};
  std::vector<float> slice = field::sample_box(*model.field, box);
  for (float& value : slice) value *= static_cast<float>(model.output_scale());
  return slice;
}

// Draws the lower x and y faces of a leaf. `zoom` is the picture pixels a pixel.
void draw_border(const field::Square& square, const Rectangle& roi, std::int64_t zoom,
                 Canvas& canvas) {
  const std::int64_t x0 = (square.x0 - roi.x0) * zoom, y0 = (square.y0 - roi.y0) * zoom;
  const std::int64_t size = square.size * zoom;
  canvas.fill(x0, y0, x0 + size, y0 + 1, kBorder);
  canvas.fill(x0, y0, x0 + 1, y0 + size, kBorder);
}

}  // namespace

void write_tree_picture(const output::Model& model, const std::filesystem::path& path) {
  const Rectangle& roi = model.roi;
  const std::vector<float> slice = central_slice(model);
  const GreyScale scale(slice);
  const std::int64_t zoom = picture_zoom(roi.width(), roi.width());
  Canvas canvas(roi.width() * zoom, roi.height() * zoom, {0, 0, 0});
  for (std::int64_t y = 0; y < roi.height(); ++y) {
    for (std::int64_t x = 0; x < roi.width(); ++x) {
      const std::uint8_t grey =
          scale.grey(static_cast<double>(slice[static_cast<std::size_t>(y * roi.width() + x)]));
      canvas.fill(x * zoom, y * zoom, (x + 1) * zoom, (y + 1) * zoom, {grey, grey, grey});
    }
  }
  const field::Quadtree& tree = model.field->tree();
  for (int leaf = 0; leaf < tree.num_leaves(); ++leaf)
    draw_border(tree.leaf(leaf).square, roi, zoom, canvas);
  canvas.write(path);
}

}  // namespace tomofield::report
