#include <fmt/format.h>

#include <cmath>

#include "field/sampling/sample_box.h"
#include "output/model_file.h"
#include "output/volume.h"
#include "tomofield/error.h"
#include "tomofield/model.h"

namespace tomofield {
namespace {

void require_usable(const SampleBox& box) {
  bool is_usable = std::isfinite(box.voxel_px) && box.voxel_px > 0;
  for (std::size_t a = 0; a < 3; ++a) {
    is_usable = is_usable && box.size[a] >= 1 && std::isfinite(box.centre_px[a]) &&
                std::isfinite(box.euler_deg[a]);
  }
  if (!is_usable)
    throw Error(fmt::format(
        "a box of {} × {} × {} voxels of {} px cannot be sampled: sizes must be at least 1 and all "
        "numbers finite",
        box.size[0], box.size[1], box.size[2], box.voxel_px));
}

}  // namespace

struct Model::Impl {
  output::Model model;
};

Model::Model(const std::filesystem::path& path)
    : impl_(std::make_shared<Impl>(Impl{output::load_model(path)})) {}

double Model::pixel_size_A() const { return impl_->model.pixel_size_A; }

SampleBox Model::region(double voxel_px) const {
  const field::OrientedBox box = output::region_box(impl_->model, voxel_px);
  return {.centre_px = box.centre_px, .size = box.size, .voxel_px = box.voxel_px};
}

std::vector<float> Model::sample(const SampleBox& box) const {
  require_usable(box);
  const auto& [rot, tilt, psi] = box.euler_deg;
  auto values = field::sample_box(*impl_->model.field,
                                  {.centre_px = box.centre_px,
                                   .size = box.size,
                                   .voxel_px = box.voxel_px,
                                   .field_from_box = field::rotation_from_euler(rot, tilt, psi)});
  const auto scale = static_cast<float>(impl_->model.output_scale());
  for (float& value : values) value = scale * value + 0.0f;  // no −0
  return values;
}

}  // namespace tomofield
