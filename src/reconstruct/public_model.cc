#include "reconstruct/public_model.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <utility>

#include "base/parallel.h"
#include "field/sampling/sample_box.h"
#include "output/volume.h"
#include "tomofield/error.h"

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

// Turns densities into values of the input's kind and contrast.
void to_output(const output::ModelInfo& model, std::vector<float>& values) {
  const auto scale = static_cast<float>(model.output_scale());
  for (float& value : values) value = scale * value + 0.0f;  // no −0
}

}  // namespace

Model::Model(std::shared_ptr<const Impl> impl) : impl_(std::move(impl)) {}

Model::Model(const std::filesystem::path& path)
    : impl_(std::make_shared<Impl>(Impl{output::load_model(path)})) {}

Model ModelAccess::make(output::Model model) {
  return Model(std::make_shared<Model::Impl>(Model::Impl{std::move(model)}));
}

double Model::pixel_size_A() const { return impl_->model.pixel_size_A; }

SampleBox Model::region(double voxel_px) const {
  const field::OrientedBox box = output::region_box(impl_->model, voxel_px);
  SampleBox region{.centre_px = box.centre_px, .size = box.size, .voxel_px = box.voxel_px};
  // An x-axis tilt turns the box about X: these Euler angles have the same matrix.
  if (!box.is_aligned())
    region.euler_deg = {90, impl_->model.geometry.hand * impl_->model.x_tilt_deg, 270};
  return region;
}

std::vector<float> Model::sample(const SampleBox& box) const {
  require_usable(box);
  const auto& [rot, tilt, psi] = box.euler_deg;
  auto values = field::sample_box(*impl_->model.field,
                                  {.centre_px = box.centre_px,
                                   .size = box.size,
                                   .voxel_px = box.voxel_px,
                                   .field_from_box = field::rotation_from_euler(rot, tilt, psi)});
  to_output(impl_->model, values);
  return values;
}

std::vector<float> Model::sample_points(std::span<const Point> points) const {
  for (const Point& point : points)
    if (!std::ranges::all_of(point, [](double number) { return std::isfinite(number); }))
      throw Error(
          fmt::format("a point at {}, {}, {} cannot be sampled: its coordinates must be "
                      "finite",
                      point[0], point[1], point[2]));
  std::vector<float> values(points.size());
  constexpr std::int64_t kBatch = 1024;
  const auto count = std::ssize(points);
  base::parallel_for((count + kBatch - 1) / kBatch, [&](std::int64_t batch) {
    const std::int64_t end = std::min(count, (batch + 1) * kBatch);
    for (auto i = static_cast<std::size_t>(batch * kBatch); i < static_cast<std::size_t>(end); ++i)
      values[i] =
          static_cast<float>(impl_->model.field->density(points[i][0], points[i][1], points[i][2]));
  });
  to_output(impl_->model, values);
  return values;
}

}  // namespace tomofield
