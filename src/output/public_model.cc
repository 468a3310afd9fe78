#include "output/public_model.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <memory>
#include <utility>
#include <vector>

#include "base/near_whole.h"
#include "base/threads/parallel.h"
#include "field/sampling/sample_box.h"
#include "output/sample_model.h"
#include "output/sampling_time.h"
#include "output/volume.h"
#include "output/volume_frame.h"
#include "tomofield/error.h"

// The public class Model of include/tomofield/model.h.

namespace tomofield {

struct Model::Impl {
  output::Model model;
  std::filesystem::path file;  // empty in memory
};

Model ModelAccess::make(output::Model model, std::filesystem::path file) {
  return Model(std::make_shared<Model::Impl>(Model::Impl{std::move(model), std::move(file)}));
}

const output::Model& ModelAccess::model(const Model& model) { return model.impl_->model; }

const std::filesystem::path& ModelAccess::file(const Model& model) { return model.impl_->file; }

namespace {

bool is_usable_voxel(double voxel_px) { return std::isfinite(voxel_px) && voxel_px > 0; }

void require_usable(const SampleBox& box) {
  bool is_usable = is_usable_voxel(box.voxel_px);
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

void require_usable_voxels(double voxel_px) {
  if (!is_usable_voxel(voxel_px))
    throw Error(
        fmt::format("voxels of {} px cannot be sampled: give a finite size above 0", voxel_px));
}

field::OrientedBox oriented_box(const SampleBox& box) {
  require_usable(box);
  const auto& [rot, tilt, psi] = box.euler_deg;
  return {.centre_px = box.centre_px,
          .size = box.size,
          .voxel_px = box.voxel_px,
          .field_from_box = field::rotation_from_euler(rot, tilt, psi)};
}

namespace output {

void to_output(const ModelInfo& model, std::vector<float>& values, bool invert) {
  const auto scale = static_cast<float>(invert ? -model.output_scale() : model.output_scale());
  for (float& value : values) value = scale * value + 0.0f;  // no −0
}

Tomogram to_tomogram(const ModelInfo& model, const field::OrientedBox& box,
                     std::vector<float> values, bool invert) {
  to_output(model, values, invert);
  return {.size = box.size,
          .voxel_size_A = box.voxel_px * model.pixel_size_A,
          .origin_A = corner_A(model, VolumeFrame(model).from_field(box)),
          .values = std::move(values)};
}

Tomogram sample_tomogram(const output::Model& model, bool invert) {
  const field::OrientedBox box = output::region_box(model, 1.0);
  return to_tomogram(model, box, output::sample_box(model, box), invert);
}

}  // namespace output

Model::Model(std::shared_ptr<const Impl> impl) : impl_(std::move(impl)) {}

Model::Model(const std::filesystem::path& path)
    : impl_([&] {
        const base::ThreadsInUse threads;
        return std::make_shared<Impl>(Impl{output::load_to_sample(path), path});
      }()) {}

double Model::pixel_size_A() const { return impl_->model.pixel_size_A; }

SampleBox Model::region(double voxel_px) const {
  require_usable_voxels(voxel_px);
  const field::OrientedBox box = output::tomogram_box(impl_->model, base::whole_if_near(voxel_px));
  return {.centre_px = box.centre_px, .size = box.size, .voxel_px = box.voxel_px};
}

std::vector<float> Model::sample(const SampleBox& box) const {
  const base::ThreadsInUse threads;
  const field::OrientedBox oriented = output::VolumeFrame(impl_->model).to_field(oriented_box(box));
  field::require_memory_of(oriented);
  output::announce_sampling(impl_->model, {&oriented, 1});
  auto values = output::sample_box(impl_->model, oriented);
  output::to_output(impl_->model, values);
  return values;
}

std::vector<float> Model::sample_points(std::span<const Point> points) const {
  const base::ThreadsInUse threads;
  for (const Point& point : points)
    if (!std::ranges::all_of(point, [](double number) { return std::isfinite(number); }))
      throw Error(
          fmt::format("a point at {}, {}, {} cannot be sampled: its coordinates must be "
                      "finite",
                      point[0], point[1], point[2]));
  const output::VolumeFrame frame(impl_->model);
  std::vector<Point> in_field;
  in_field.reserve(points.size());
  for (const Point& point : points) in_field.push_back(frame.to_field(point));
  std::vector<float> values = output::sample_points(impl_->model, in_field);
  output::to_output(impl_->model, values);
  return values;
}

}  // namespace tomofield
