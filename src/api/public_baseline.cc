#include <utility>
#include <vector>

#include "api/public_call.h"
#include "baseline/method.h"
#include "baseline/method_options.h"
#include "baseline/run_baseline.h"
#include "io/saving/output_lock.h"
#include "tilt_series/tilt_series.h"
#include "tomofield/baseline.h"

namespace tomofield {
namespace {

// Ends a baseline when the callback wants to stop.
struct Stopped {};

baseline::Method method_of(BaselineMethod method) {
  switch (method) {
    case BaselineMethod::kWbp:
      return baseline::WbpOptions{};
    case BaselineMethod::kSirt:
      return baseline::SirtOptions{};
    case BaselineMethod::kSartTv:
      return baseline::SartTvOptions{};
    case BaselineMethod::kTv:
      return baseline::TvOptions{};
    case BaselineMethod::kIngp:
      return baseline::IngpOptions{};
    case BaselineMethod::kFourierNet:
      return baseline::FourierNetOptions{};
  }
  return baseline::WbpOptions{};
}

// Checks the options, and locks the files of a run that writes some.
std::vector<io::OutputLock> claim(const baseline::BaselineOptions& request) {
  if (!request.shared.run.output.empty()) return baseline::claim_outputs(request);
  baseline::check_options(request);
  return {};
}

}  // namespace

Baseline reconstruct_baseline(const TiltSeries& series, BaselineMethod method,
                              const Options& options, const MethodOptions& method_options,
                              const ProgressCallback& progress) {
  const api::OneAtATime turn;
  const auto& input = TiltSeriesAccess::impl(series);
  baseline::BaselineOptions request{
      .files = input.files, .shared = options, .method = method_of(method), .images = input.images};
  baseline::set_options(method_options, request);
  baseline::settle(request);
  const std::vector<io::OutputLock> locks = claim(request);
  const tilt_series::TiltSeries opened(request.input());
  baseline::plan_baseline(opened, request);
  api::Listener listener(progress);
  const auto tell = [&](bool is_trial) {
    return [&, is_trial](const base::ProgressReport& report) {
      listener.tell(report, is_trial);
      if (listener.wants_stop()) throw Stopped();
    };
  };
  try {
    baseline::BaselineSummary made =
        baseline::run_baseline(opened, request, {tell(true), tell(false)});
    return {true, std::move(made.tomogram), std::move(made.record)};
  } catch (const Stopped&) {
    listener.rethrow();
    return {};
  }
}

}  // namespace tomofield
