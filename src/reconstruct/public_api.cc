#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <memory>
#include <mutex>
#include <utility>

#include "base/log.h"
#include "base/parallel.h"
#include "field/sampling/sample_box.h"
#include "io/image_stack.h"
#include "io/json.h"
#include "output/model_file.h"
#include "output/sample_model.h"
#include "output/volume.h"
#include "reconstruct/aligned_series.h"
#include "reconstruct/exchange_files.h"
#include "reconstruct/options.h"
#include "reconstruct/reconstruct.h"
#include "tomofield/error.h"
#include "tomofield/messages.h"
#include "tomofield/model.h"
#include "tomofield/reconstruct.h"

// The public functions and classes of include/tomofield/, apart from evaluate().
namespace tomofield {

struct Model::Impl {
  output::Model model;
};

// Makes a public model, whose constructor is private.
struct ModelAccess {
  static Model make(output::Model model) {
    return Model(std::make_shared<Model::Impl>(Model::Impl{std::move(model)}));
  }
};

struct TiltSeries::Impl {
  SeriesFiles files;
  std::shared_ptr<const io::ImageStack> images;  // none: the files
};

struct TiltSeriesAccess {
  static const TiltSeries::Impl& impl(const TiltSeries& series) { return *series.impl_; }
};

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

// Turns densities into values of the input's kind and contrast, or of the inverted contrast.
void to_output(const output::ModelInfo& model, std::vector<float>& values, bool invert = false) {
  const auto scale = static_cast<float>(invert ? -model.output_scale() : model.output_scale());
  for (float& value : values) value = scale * value + 0.0f;  // no −0
}

reconstruction::ReconstructOptions internal_options(const TiltSeries& series,
                                                    const Options& options) {
  const auto& input = TiltSeriesAccess::impl(series);
  auto internal = reconstruction::run_options(input.files, options);
  internal.input.images = input.images;
  return internal;
}

// Samples the region of interest at the voxels that write_volume() writes, as floats in the order
// z, y, x.
Tomogram sample_tomogram(const output::Model& model, bool invert) {
  const field::OrientedBox box = output::region_box(model, 1.0);
  Tomogram tomogram{.size = box.size,
                    .voxel_size_A = model.pixel_size_A,
                    .values = output::sample_box(model, box)};
  to_output(model, tomogram.values, invert);
  return tomogram;
}

// Calls the callback after every step and remembers whether it wants to stop.
class Listener {
 public:
  explicit Listener(const ProgressCallback& callback) : callback_(callback) {}

  reconstruction::ReconstructHooks hooks() {
    if (!callback_) return {};
    return {.progress = [this](const base::ProgressReport& report) { tell(report, false); },
            .tune_progress = [this](const base::ProgressReport& report) { tell(report, true); },
            .stop_requested = [this] { return wants_stop_; }};
  }

 private:
  void tell(const base::ProgressReport& report, bool is_trial) {
    const bool goes_on = callback_({.fraction_done = report.fraction_done,
                                    .seconds_elapsed = report.seconds_elapsed,
                                    .seconds_left = report.seconds_left,
                                    .is_trial = is_trial,
                                    .detail = report.detail});
    wants_stop_ = wants_stop_ || !goes_on;
  }

  const ProgressCallback& callback_;
  bool wants_stop_ = false;
};

// Waits until no other thread reconstructs. Throws Error in a callback, which would wait for
// itself.
class OneAtATime {
 public:
  OneAtATime() {
    if (is_reconstructing_)
      throw Error("a callback cannot start another reconstruction: start it when this one is done");
    mutex_.lock();
    is_reconstructing_ = true;
  }
  ~OneAtATime() {
    is_reconstructing_ = false;
    mutex_.unlock();
  }
  OneAtATime(const OneAtATime&) = delete;
  OneAtATime& operator=(const OneAtATime&) = delete;

 private:
  static inline std::mutex mutex_;
  static inline thread_local bool is_reconstructing_ = false;
};

}  // namespace

Model::Model(std::shared_ptr<const Impl> impl) : impl_(std::move(impl)) {}

Model::Model(const std::filesystem::path& path)
    : impl_(std::make_shared<Impl>(Impl{output::load_to_sample(path)})) {}

double Model::pixel_size_A() const { return impl_->model.pixel_size_A; }

SampleBox Model::region(double voxel_px) const {
  if (!is_usable_voxel(voxel_px))
    throw Error(
        fmt::format("voxels of {} px cannot be sampled: give a finite size above 0", voxel_px));
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
  auto values = output::sample_box(impl_->model,
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
  std::vector<float> values = output::sample_points(impl_->model, points);
  to_output(impl_->model, values);
  return values;
}

TiltSeries::TiltSeries(std::shared_ptr<const Impl> impl) : impl_(std::move(impl)) {}

TiltSeries TiltSeries::from_files(SeriesFiles files) {
  return TiltSeries(std::make_shared<Impl>(Impl{.files = std::move(files), .images = {}}));
}

TiltSeries TiltSeries::from_images(ViewImages images) {
  return TiltSeries(std::make_shared<Impl>(Impl{
      .files = {},
      .images = io::image_stack_in_memory(std::move(images.values), images.width, images.height,
                                          std::move(images.tilt_deg), images.pixel_size_A)}));
}

Reconstruction reconstruct(const TiltSeries& series, const Options& options,
                           const ProgressCallback& progress) {
  const OneAtATime turn;
  reconstruction::ReconstructOptions internal = internal_options(series, options);
  const auto locks = reconstruction::claim_outputs(internal);
  Listener listener(progress);
  reconstruction::ReconstructHooks hooks = listener.hooks();
  reconstruction::check_before_alignment(internal);
  if (!reconstruction::align_series(internal, hooks, distributed::Communicator::alone())) return {};
  const tilt_series::TiltSeries views(internal.input);
  const reconstruction::RunPlan plan = reconstruction::plan_run(views, internal);
  require_memory(plan);
  require_few_vertices(plan);
  hooks.write_more = [&](const reconstruction::Results&, const std::filesystem::path& volume) {
    reconstruction::write_exchange_files(views, internal, volume);
  };
  reconstruction::RunResult run = reconstruction::reconstruct(views, internal, hooks);
  if (!run.results) return {};
  Reconstruction made{.is_finished = true,
                      .tomogram = {},
                      .model = {},
                      .metrics = io::json_text(run.results->metrics)};
  if (options.output.empty()) made.tomogram = sample_tomogram(*run.results->model, options.invert);
  if (run.results->model) made.model = ModelAccess::make(std::move(*run.results->model));
  return made;
}

Options resolve_options(const Options& options, const SeriesFiles& files) {
  return reconstruction::resolve(files, options);
}

void set_message_handler(MessageHandler handler) {
  if (!handler) return base::set_log_sink({});
  base::set_log_sink([handler = std::move(handler)](base::LogLevel level, std::string_view text) {
    handler(level == base::LogLevel::kWarning ? MessageKind::kWarning : MessageKind::kInfo, text);
  });
}

void set_thread_count(int count) { base::set_thread_count(count); }

}  // namespace tomofield
