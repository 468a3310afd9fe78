#include "align/alignment.h"

#include <fmt/format.h>

#include <algorithm>
#include <limits>
#include <optional>
#include <utility>

#include "align/aligning_fit.h"
#include "align/gauge.h"
#include "align/local/local_alignment.h"
#include "align/registration.h"
#include "align/start/axis_search.h"
#include "align/start/correlation_start.h"
#include "align/trial.h"
#include "align/unalike.h"
#include "base/progress.h"
#include "base/threads/parallel.h"
#include "base/trace.h"
#include "measurement/prepare.h"
#include "tilt_series/resampling/align_image.h"
#include "tilt_series/resampling/binning.h"
#include "tomofield/error.h"

namespace tomofield::alignment {
namespace {

// Views are correlated in images of at most about this width and height.
constexpr double kCorrelatedSize = 96;
// Standard errors by which a new alignment must predict held-out views better.
constexpr double kSure = 2.0;

// Returns the views that do not resemble their projections.
std::vector<int> unalike_views(const tilt_series::TiltSeries& series,
                               const std::vector<ViewAgreement>& agreement) {
  std::vector<double> tilts, correlations;
  for (const tilt_series::View& view : series.views()) tilts.push_back(view.tilt_deg);
  for (const ViewAgreement& view : agreement) correlations.push_back(view.correlation);
  return unalike(tilts, correlations);
}

// Looks for local motion beyond the corrections of an alignment, whose trial is `rigid`.
void add_motion(const JointProblem& problem, AlignmentTrial& rigid,
                const distributed::Communicator& processes, Alignment& alignment) {
  LocalAlignment found = align_locally(problem, alignment.joint.freedoms, alignment.corrections,
                                       alignment.joint.motion, processes);
  AlignmentTrial with_motion(problem, found.corrections, processes);
  LocalTrial trial{.held_out = compare(rigid, with_motion), .steps_px = std::move(found.steps_px)};
  trial.is_accepted = trial.held_out.gain.exceeds(kSure);
  if (trial.is_accepted) {
    alignment.corrections = std::move(found.corrections);
    alignment.joint.agreement = std::move(found.agreement);
  }
  alignment.local = std::move(trial);
}

// Refines what changes slowly over the tilts in a joint alignment: with gold beads, if they help,
// or else the direction of the tilt axis alone. Local motion that was found keeps its direction,
// since it is no more than a start.
void refine_slow_part(const JointProblem& problem, const distributed::Communicator& processes,
                      Alignment& alignment) {
  JointAlignment& joint = alignment.joint;
  alignment.beads = align_by_beads(problem, joint.corrections, joint.freedoms, processes);
  if (alignment.beads && alignment.beads->is_accepted) {
    for (std::size_t view = 0; view < joint.corrections.size(); ++view)
      joint.corrections[view] = joint.corrections[view].then(alignment.beads->steps[view]);
    remove_gauge(problem.plan.geometry, joint.corrections);
    joint.freedoms.rotation = true;
  } else if (joint.freedoms.rotation) {
    joint.corrections = with_refined_axis(problem, joint.corrections, processes);
  }
}

}  // namespace

void require_views(std::size_t num_views) {
  if (num_views < kFewestViews)
    throw Error(
        fmt::format("--align needs at least {} views, since it judges the alignment by "
                    "views that it holds out, and there are {}",
                    kFewestViews, num_views));
}

FieldOptions planned_field(const FieldOptions& field) { return aligning_field(field); }

std::size_t memory_beside_fit(const measurement::Measurement& plan) {
  return prediction_memory(plan);
}

double seconds_of_update(std::span<const float> image, std::int64_t width) {
  const std::int64_t height = std::ssize(image) / width;
  tilt_series::MaskedImage view(width, height);
  std::ranges::copy(image, view.values.begin());
  std::ranges::fill(view.valid, std::uint8_t{1});
  geometry::RawFromAligned half_a_pixel;
  half_a_pixel.shift_x_px = half_a_pixel.shift_y_px = 0.5;
  const base::ProcessorStopwatch running;
  const tilt_series::MaskedImage moved =
      tilt_series::align_image(view, half_a_pixel, width, height, std::nullopt);
  const Registration registration({.width = width,
                                   .height = height,
                                   .centre_x = static_cast<double>(width) / 2,
                                   .centre_y = static_cast<double>(height) / 2,
                                   .measured = moved.values,
                                   .predicted = view.values},
                                  {});
  return running.seconds();
}

std::vector<PlannedFits> planned_fits(const measurement::Measurement& plan, bool from_raw,
                                      std::uint64_t seed) {
  constexpr std::int64_t kAll = std::numeric_limits<std::int64_t>::max();
  // The held-out views judge the old and the new alignment, mostly with wide pixels alone.
  std::vector<PlannedFits> fits{{joint_fit(seed), kAll, 1, 23.0},
                                {held_out_fit(seed), kHeldOutCoarseEpochs, 2, 1.0}};
  if (can_refine_axis(plan)) fits.push_back({axis_fit(seed), kAxisEpochs, kAxisFits, 0.5});
  if (from_raw) fits.push_back({joint_fit(seed), kResidualEpochs, kMostAxisFits, 2.5});
  return fits;
}

std::vector<geometry::ViewCorrection> correlated_start(const JointProblem& problem) {
  const base::TraceSpan span("correlate views");
  const tilt_series::TiltSeries& series = problem.recorded;
  const double reduction =
      std::max(1.0, static_cast<double>(std::max(series.aligned_width(), series.aligned_height())) /
                        kCorrelatedSize);
  std::vector<CoarseView> views(series.views().size());
  base::parallel_for("reduce views", std::ssize(views), [&](std::int64_t i) {
    const auto view = static_cast<std::size_t>(i);
    views[view] = {
        tilt_series::reduce_image(measurement::read_aligned(series, view, {}), reduction),
        series.views()[view].tilt_deg};
  });
  const double pixel = reduction * series.bin_factor();
  const CorrelationStart found =
      correlate_views(views, {.thickness_px = problem.plan.geometry.thickness / reduction});
  std::vector<geometry::ViewCorrection> corrections;
  for (const auto& [x, y] : found.shift_px)
    corrections.push_back({.shift_x_px = x * pixel, .shift_y_px = y * pixel});
  remove_gauge(problem.plan.geometry, corrections);
  return corrections;
}

Alignment refine_alignment(const JointProblem& problem, std::vector<geometry::ViewCorrection> start,
                           const distributed::Communicator& processes) {
  const std::vector<geometry::ViewCorrection> none(problem.recorded.views().size());
  Alignment alignment;
  alignment.joint = align_jointly(problem, std::move(start), processes);
  refine_slow_part(problem, processes, alignment);
  alignment.unaligned = unalike_views(problem.recorded, alignment.joint.agreement);
  std::optional<AlignmentTrial> before(std::in_place, problem, none, processes);
  std::optional<AlignmentTrial> after(std::in_place, problem, alignment.joint.corrections,
                                      processes);
  alignment.held_out = compare(*before, *after);
  alignment.is_accepted = alignment.held_out.gain.exceeds(kSure);
  alignment.corrections = alignment.is_accepted ? alignment.joint.corrections : none;
  (alignment.is_accepted ? before : after).reset();  // the fit of local motion needs the memory
  if (!alignment.joint.motion.empty())
    add_motion(problem, alignment.is_accepted ? *after : *before, processes, alignment);
  return alignment;
}

}  // namespace tomofield::alignment
