#include "align/start/axis_search.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <numbers>

#include "align/aligning_fit.h"
#include "align/start/axis_line.h"
#include "base/log.h"
#include "base/progress.h"
#include "base/trace.h"
#include "fit/fit.h"

namespace tomofield::alignment {
namespace {

constexpr double kRadian_deg = 180.0 / std::numbers::pi;
// Far directions tell the way best where views are noisy, and near ones the place.
constexpr double kFarStep_deg = 4.0;
// The last parabola has its points so far apart: closer ones differ by less than the fits do.
constexpr double kNearStep_deg = 1.0, kLastStep_deg = 0.5;
// A joint alignment leaves a smaller error of the axis.
constexpr double kRefinedStep_deg = 1.0, kRefinedRange_deg = 3.0;
// Standard errors over the views by which residuals of fits must differ, because noise makes them
// differ as well. Each fit of the search also aligns the views again, which makes it less certain.
constexpr double kSure = 2.0, kSureOfSearch = 3.0;
// The fits that refine the axis have pixels wider by this factor.
constexpr int kAxisBin = 2;
// In narrower views, other slow errors of an alignment move the lowest place by up to 0.4°.
constexpr std::int64_t kNarrowest_px = 192;

std::vector<geometry::ViewCorrection> turned(std::vector<geometry::ViewCorrection> corrections,
                                             double axis_deg) {
  for (geometry::ViewCorrection& correction : corrections)
    correction = correction.then({.rotation_rad = axis_deg / kRadian_deg});
  return corrections;
}

// Returns the residual of each view after a fit with wide pixels.
std::vector<double> wide_residuals(const JointProblem& problem,
                                   const std::vector<geometry::ViewCorrection>& corrections,
                                   const distributed::Communicator& processes) {
  const FieldOptions field = aligning_field(problem.field);
  const measurement::Measurement views =
      aligning_measurement(problem, corrections, kAxisBin, field, processes);
  fit::Fit fit(views, field, axis_fit(problem.seed), processes);
  run_with_wide_pixels(fit, kAxisEpochs, problem, processes);
  return inner_residuals(fit, views, fit.stage());
}

// Returns residuals of the views of an alignment.
using Residuals = std::vector<double>(const JointProblem&,
                                      const std::vector<geometry::ViewCorrection>&,
                                      const distributed::Communicator&);

// Returns the residuals of views that are turned by an axis, as a function that reports the
// progress of a search of about `num_fits` fits and asks whether to stop it.
AxisLine::Residuals of_axis(const JointProblem& problem,
                            const std::vector<geometry::ViewCorrection>& start, int num_fits,
                            Residuals* residuals, const distributed::Communicator& processes) {
  return
      [&, residuals, num_fits, num_done = 0, running = base::Stopwatch()](double axis_deg) mutable {
        check_stop(problem, processes);
        std::vector<double> found = residuals(problem, turned(start, axis_deg), processes);
        ++num_done;
        if (problem.progress)
          problem.progress(
              base::progress_at(std::min(1.0, static_cast<double>(num_done) / num_fits),
                                running.seconds(), fmt::format("tilt axis, fit {}", num_done)));
        return found;
      };
}

}  // namespace

std::vector<geometry::ViewCorrection> with_best_axis(
    const JointProblem& problem, const std::vector<geometry::ViewCorrection>& start,
    const distributed::Communicator& processes) {
  const base::TraceSpan span("find tilt axis");
  AxisLine line(of_axis(problem, start, kMostAxisFits, coarse_residuals, processes), kSureOfSearch);
  double best = line.downhill(0.0, kFarStep_deg);
  if (line.leans(best, kFarStep_deg)) best = line.lowest(best, kFarStep_deg, kFarStep_deg);
  for (double step = kNearStep_deg; step >= kLastStep_deg; step /= 2)
    best = line.downhill(best, step);
  const double axis_deg = line.lowest(best, kLastStep_deg, kNearStep_deg);
  if (axis_deg == 0.0)
    base::log_info(
        "the tilt axis stays where the files have it, since the views are too noisy to tell "
        "another "
        "direction: make sure that it is right");
  else
    base::log_info(
        fmt::format("the tilt axis is turned by {:.2f}° from where the files have it", axis_deg));
  return turned(start, axis_deg);
}

bool can_refine_axis(const measurement::Measurement& plan) {
  return std::min(plan.geometry.width, plan.rays_shape().num_rows) >= kNarrowest_px;
}

FitOptions axis_fit(std::uint64_t seed) { return aligning_fit(kAxisEpochs, 1, seed); }

std::vector<geometry::ViewCorrection> with_refined_axis(
    const JointProblem& problem, const std::vector<geometry::ViewCorrection>& start,
    const distributed::Communicator& processes) {
  if (!can_refine_axis(problem.plan)) return start;
  const base::TraceSpan span("refine tilt axis");
  AxisLine line(of_axis(problem, start, kAxisFits, wide_residuals, processes), kSure);
  const double axis_deg = line.lowest(line.descend(0.0, kRefinedStep_deg, kRefinedRange_deg),
                                      kRefinedStep_deg, kRefinedStep_deg);
  base::log_info(fmt::format("refined the tilt axis by {:.2f}°", axis_deg));
  return turned(start, axis_deg);
}

}  // namespace tomofield::alignment
