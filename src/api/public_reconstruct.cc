#include <memory>
#include <mutex>
#include <utility>

#include "base/log.h"
#include "base/threads/parallel.h"
#include "io/images/image_stack.h"
#include "io/json.h"
#include "options/run_options.h"
#include "output/public_model.h"
#include "reconstruct/reconstruct.h"
#include "record/run_record.h"
#include "tomofield/error.h"
#include "tomofield/messages.h"
#include "tomofield/reconstruct.h"

// The public functions and classes of include/tomofield/, apart from Model and evaluate().
namespace tomofield {

struct TiltSeries::Impl {
  SeriesFiles files;
  std::shared_ptr<const io::ImageStack> images;  // none: the files
};

struct TiltSeriesAccess {
  static const TiltSeries::Impl& impl(const TiltSeries& series) { return *series.impl_; }
};

namespace {

options::ReconstructOptions internal_options(const TiltSeries& series, const Options& options) {
  const auto& input = TiltSeriesAccess::impl(series);
  auto internal = options::run_options(input.files, options);
  internal.images = input.images;
  return internal;
}

// Calls the callback after every step and remembers whether it wants to stop.
class Listener {
 public:
  explicit Listener(const ProgressCallback& callback) : callback_(callback) {}

  reconstruction::Observer observer() {
    if (!callback_) return {};
    const auto tell_trial = [this](const base::ProgressReport& report) { tell(report, true); };
    return {.planned = {},
            .alignment = tell_trial,
            .trials = tell_trial,
            .fit = [this](const base::ProgressReport& report) { tell(report, false); },
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
  Listener listener(progress);
  reconstruction::RunResult run =
      reconstruction::run(internal_options(series, options), listener.observer());
  if (run.outcome != reconstruction::Outcome::kFinished) return {};
  Reconstruction made{.is_finished = true,
                      .tomogram = {},
                      .model = {},
                      .metrics = io::json_text(record::to_json(run.record))};
  if (options.run.output.empty())
    made.tomogram = output::sample_tomogram(*run.model, options.volume.invert);
  if (run.model) made.model = ModelAccess::make(std::move(*run.model));
  return made;
}

bool align(const TiltSeries& series, const Options& options, const ProgressCallback& progress) {
  const OneAtATime turn;
  Listener listener(progress);
  options::ReconstructOptions internal = internal_options(series, options);
  return reconstruction::align(internal, listener.observer());
}

Options resolve_options(const Options& options, const SeriesFiles& files) {
  return options::resolve(files, options);
}

void set_message_handler(MessageHandler handler) {
  if (!handler) return base::set_log_sink({});
  base::set_log_sink([handler = std::move(handler)](base::LogLevel level, std::string_view text) {
    handler(level == base::LogLevel::kWarning ? MessageKind::kWarning : MessageKind::kInfo, text);
  });
}

void set_thread_count(int count) { base::set_thread_count(count); }

}  // namespace tomofield
