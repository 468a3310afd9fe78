#include "tomofield/reconstruct.h"

#include <mutex>
#include <utility>

#include "base/log.h"
#include "base/parallel.h"
#include "field/sampling/sample_box.h"
#include "io/image_stack.h"
#include "io/json.h"
#include "io/scratch_memory.h"
#include "output/volume.h"
#include "reconstruct/public_model.h"
#include "reconstruct/reconstruct.h"
#include "reconstruct/resolve.h"
#include "tomofield/error.h"
#include "tomofield/messages.h"

namespace tomofield {

struct TiltSeries::Impl {
  SeriesFiles files;
  std::shared_ptr<const io::ImageStack> images;  // none: the files
};

struct TiltSeriesAccess {
  static const TiltSeries::Impl& impl(const TiltSeries& series) { return *series.impl_; }
};

namespace {

reconstruction::ReconstructOptions internal_options(const TiltSeries& series,
                                                    const Options& options) {
  const auto& input = TiltSeriesAccess::impl(series);
  auto internal = reconstruction::run_options(input.files, options);
  internal.input.images = input.images;
  internal.input.scratch_dir = io::scratch_directory(options.output);
  return internal;
}

// Samples the region of interest as write_volume() does, but for the type and the axes of a file.
Tomogram sample_tomogram(const output::Model& model, bool invert) {
  const field::OrientedBox box = output::region_box(model, 1.0);
  const auto scale = static_cast<float>(invert ? -model.output_scale() : model.output_scale());
  Tomogram tomogram{.size = box.size,
                    .voxel_size_A = model.pixel_size_A,
                    .values = field::sample_box(*model.field, box)};
  for (float& value : tomogram.values) value = scale * value + 0.0f;  // no −0
  return tomogram;
}

// Asks the callback after every step, and remembers that it wants to stop.
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
  const reconstruction::ReconstructOptions internal = internal_options(series, options);
  reconstruction::check_options(internal);
  const tilt_series::TiltSeries views(internal.input);
  reconstruction::plan_run(views, internal);
  Listener listener(progress);
  reconstruction::RunResult run = reconstruction::reconstruct(views, internal, listener.hooks());
  if (!run.results) return {};
  Reconstruction made{.is_finished = true,
                      .tomogram = {},
                      .model = {},
                      .metrics = io::json_text(run.results->metrics)};
  if (options.output.empty()) made.tomogram = sample_tomogram(run.results->model, options.invert);
  made.model = ModelAccess::make(std::move(run.results->model));
  return made;
}

Options resolve_options(const Options& options) { return reconstruction::resolve(options); }

void set_message_handler(MessageHandler handler) {
  if (!handler) return base::set_log_sink({});
  base::set_log_sink([handler = std::move(handler)](base::LogLevel level, std::string_view text) {
    handler(level == base::LogLevel::kWarning ? MessageKind::kWarning : MessageKind::kInfo, text);
  });
}

void set_thread_count(int count) { base::set_thread_count(count); }

}  // namespace tomofield
