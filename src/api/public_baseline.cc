#include <utility>
#include <variant>

#include "api/public_call.h"
#include "baseline/method.h"
#include "baseline/run_baseline.h"
#include "tilt_series/tilt_series.h"
#include "tomofield/baseline.h"
#include "tomofield/error.h"

namespace tomofield {
namespace {

// Ends a baseline when the callback wants to stop.
struct Stopped {};

baseline::Method method_of(BaselineMethod method, Contrast contrast) {
  baseline::Method made = [&]() -> baseline::Method {
    switch (method) {
      case BaselineMethod::kWbp:
        return baseline::WbpOptions{};
      case BaselineMethod::kSirt:
        return baseline::SirtOptions{};
      case BaselineMethod::kSartTv:
        return baseline::SartTvOptions{};
      case BaselineMethod::kTv:
        return baseline::TvOptions{};
    }
    return baseline::WbpOptions{};
  }();
  std::visit(
      [&](auto& options) {
        if constexpr (requires { options.non_negative; })
          options.non_negative = contrast != Contrast::kDark;
      },
      made);
  return made;
}

}  // namespace

Baseline reconstruct_baseline(const TiltSeries& series, BaselineMethod method,
                              const Options& options, const ProgressCallback& progress) {
  const api::OneAtATime turn;
  if (!options.run.output.empty())
    throw Error("a baseline stays in memory: write its tomogram with write_mrc()");
  const auto& input = TiltSeriesAccess::impl(series);
  const baseline::BaselineOptions request{.files = input.files,
                                          .shared = options,
                                          .method = method_of(method, options.views.contrast),
                                          .images = input.images};
  baseline::check_options(request);
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
    return {true, std::move(*made.tomogram), made.record};
  } catch (const Stopped&) {
    listener.rethrow();
    return {};
  }
}

}  // namespace tomofield
