#include <fmt/format.h>

#include <filesystem>
#include <memory>
#include <utility>

#include "api/public_call.h"
#include "base/log.h"
#include "base/threads/parallel.h"
#include "io/images/image_stack.h"
#include "options/run_options.h"
#include "output/output_paths.h"
#include "output/public_model.h"
#include "reconstruct/reconstruct.h"
#include "record/run_record.h"
#include "tomofield/error.h"
#include "tomofield/messages.h"
#include "tomofield/reconstruct.h"

namespace tomofield {

namespace {

options::ReconstructOptions internal_options(const TiltSeries& series, const Options& options) {
  const auto& input = TiltSeriesAccess::impl(series);
  auto internal = options::run_options(input.files, options);
  internal.images = input.images;
  // A callback or another thread may change the folder in which names begin.
  if (std::filesystem::path& output = internal.run.output; !output.empty())
    output = std::filesystem::absolute(output);
  return internal;
}

// Returns what tells a listener of a reconstruction.
reconstruction::Observer observer_of(api::Listener& listener) {
  if (!listener.has_callback()) return {};
  const auto tell_trial = [&](const base::ProgressReport& report) { listener.tell(report, true); };
  return {.planned = {},
          .alignment = tell_trial,
          .trials = tell_trial,
          .fit = [&](const base::ProgressReport& report) { listener.tell(report, false); },
          .stop_requested = [&] { return listener.wants_stop(); }};
}

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
  const api::OneAtATime turn;
  api::Listener listener(progress);
  reconstruction::RunResult run =
      reconstruction::run(internal_options(series, options), observer_of(listener));
  listener.rethrow();
  if (run.outcome != reconstruction::Outcome::kFinished) return {};
  Reconstruction made{.is_finished = true,
                      .tomogram = {},
                      .model = {},
                      .metrics = record::text_of(run.record),
                      .options = std::move(run.options)};
  if (options.run.output.empty())
    made.tomogram = output::sample_tomogram(*run.model, options.volume.invert);
  if (run.model) {
    const std::filesystem::path& volume = options.run.output;
    made.model = ModelAccess::make(std::move(*run.model),
                                   volume.empty() ? volume : output::output_paths(volume).model);
  }
  return made;
}

bool align(const TiltSeries& series, const Options& options, const ProgressCallback& progress) {
  const api::OneAtATime turn;
  api::Listener listener(progress);
  options::ReconstructOptions internal = internal_options(series, options);
  const bool is_finished = reconstruction::align(internal, observer_of(listener));
  listener.rethrow();
  return is_finished;
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

void set_thread_count(std::int64_t count) {
  if (count < 0 || count > base::kMostThreads)
    throw Error(
        fmt::format("the number of threads must be from 1 to {}, or 0 for the default, not {}",
                    base::kMostThreads, count));
  base::set_thread_count(static_cast<int>(count));
}

}  // namespace tomofield
