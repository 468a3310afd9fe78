#include "field/sampling/middle_plane.h"

#include "field/sampling/sample_box.h"

namespace tomofield::field {

std::vector<float> middle_plane(const Field& field, const Rectangle& region) {
  OrientedBox box;
  box.size = {region.width(), region.height(), 1};
  box.centre_px = {0.5 * static_cast<double>(region.x0 + region.x1),
                   0.5 * static_cast<double>(region.y0 + region.y1), 0.5 * field.thickness()};
  return sample_box(field, box);
}

}  // namespace tomofield::field
