#include "reconstruct/run_fit.h"

#include <fmt/format.h>

#include <cstdint>
#include <string>

#include "base/log.h"
#include "base/progress.h"
#include "base/trace.h"
#include "checkpoint/checkpoint.h"
#include "options/run_options.h"
#include "tomofield/error.h"

namespace tomofield::reconstruction {
namespace {

std::unique_ptr<fit::Fit> begin_fit(const Run& run, const FitJob& job) {
  const base::TraceSpan span("begin fit");
  FitOptions options = options::with_denoise(run.options.fit);
  if (!job.may_learn) options.prior = Prior::kTv;
  auto fit = std::make_unique<fit::Fit>(job.measurement, run.options.field, options, run.processes,
                                        job.part);
  if (!job.kept_views.empty()) fit->keep_views(job.kept_views);
  return fit;
}

// Continues from the checkpoint, if there is one yet.
void resume(const FitJob& job, fit::Fit& fit) {
  const base::TraceSpan span("read checkpoint");
  const std::filesystem::path& path = job.model;
  if (!std::filesystem::exists(path)) {
    base::log_info(fmt::format("no checkpoint {} yet: starting from the beginning", path.string()));
    return;
  }
  checkpoint::read_checkpoint([&] { checkpoint::restore_fit(path, job.origin.fingerprint, fit); });
  base::log_info(fmt::format("resuming {} at step {} of {}", path.string(), fit.progress().step,
                             fit.num_steps()));
}

base::ProgressReport progress_report(const fit::Fit& fit, std::int64_t first_step,
                                     const base::Stopwatch& running) {
  const std::int64_t step = fit.progress().step;
  const double first = fit.work(first_step), done = fit.work(step), all = fit.work(fit.num_steps());
  const double seconds = running.seconds();
  const double rate = static_cast<double>(step - first_step) / seconds;
  const auto& loss = fit.progress().data_loss;
  const std::int64_t epoch = (step - 1) / fit.steps_per_epoch() + 1;
  const auto& held_out = fit.progress().held_out_error;
  base::ProgressReport report = base::progress_at(
      (done - first) / (all - first), seconds,
      fmt::format("epoch {}/{}  loss {}{}  {:.1f} steps/s", epoch, fit.num_epochs(),
                  loss.empty() ? "-" : fmt::format("{:.4f}", loss.back()),
                  held_out.empty() ? "" : fmt::format("  held out {:.4f}", held_out.back()), rate));
  report.fraction_done = done / all;
  return report;
}

// Takes the steps and saves checkpoints when they are due, if the run writes files. Returns false
// if it was stopped; there is a checkpoint then.
bool run_with_checkpoints(const Run& run, const FitJob& job, fit::Fit& fit) {
  const base::TraceSpan span("fit");
  const double seconds_between = 60 * run.options.run.checkpoint_minutes;
  const base::Stopwatch running;
  base::Stopwatch since_checkpoint;
  const std::int64_t first_step = fit.progress().step;
  bool stopped = false;
  fit.run([&](const fit::Fit&) {
    if (job.progress) job.progress(progress_report(fit, first_step, running));
    const auto& stop_requested = run.observer.stop_requested;
    const bool stop = stop_requested && stop_requested() && !fit.is_done();
    const bool is_due = run.processes.is_root() && since_checkpoint.seconds() > seconds_between;
    // Any process can stop all of them. The root decides when it is time for a checkpoint.
    const double wanted = run.processes.allreduce_max(stop ? 2.0 : is_due ? 1.0 : 0.0);
    stopped = wanted == 2.0;
    if (wanted > 0.0 && run.writes_files()) {
      checkpoint::save_checkpoint(job.model, fit,
                                  checkpoint::model_info(job.measurement, run.options), job.origin);
      since_checkpoint.restart();
    }
    return !stopped;
  });
  return !stopped;
}

}  // namespace

FitRun run_fit(const Run& run, const FitJob& job) {
  FitRun made{.fit = begin_fit(run, job)};
  if (job.resumes) run.processes.run_collectively([&] { resume(job, *made.fit); });
  const std::int64_t first_step = made.fit->progress().step;
  const base::Stopwatch running;
  made.was_stopped = !run_with_checkpoints(run, job, *made.fit);
  made.seconds = running.seconds();
  made.took_steps = made.fit->progress().step > first_step;
  return made;
}

}  // namespace tomofield::reconstruction
