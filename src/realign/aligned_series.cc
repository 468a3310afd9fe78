#include "realign/aligned_series.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <filesystem>
#include <string>
#include <utility>
#include <vector>

#include "align/alignment.h"
#include "align/start/axis_search.h"
#include "base/log.h"
#include "base/progress.h"
#include "base/trace.h"
#include "measurement/prepare.h"
#include "output/output_paths.h"
#include "realign/alignment_origin_record.h"
#include "tilt_series/tilt_series.h"

namespace tomofield::realign {
namespace {

std::string describe_errors(const alignment::Comparison& compared) {
  return fmt::format(
      "held-out views are predicted with an error of {:.4f} (before: {:.4f}; the difference is "
      "known to {:.4f})",
      compared.after, compared.before, compared.gain.error);
}

void log_local_motion(const alignment::LocalRecord& local) {
  const std::string errors = describe_errors(local.trial.held_out);
  if (local.trial.is_accepted) {
    base::log_info(fmt::format(
        "undone: local motion of {:.2f} pixels (root mean square), which the files for other "
        "programs do not hold; {}",
        local.rms_px, errors));
  } else {
    base::log_info(
        "local motion that the views seem to have is not undone, since they are not sure to be "
        "predicted better: " +
        errors);
  }
}

// Says how well gold beads keep their places.
void log_beads(const alignment::BeadRecord& beads) {
  base::log_info(fmt::format(
      "{} gold beads lie {:.2f} pixels (root mean square in x and y) from their places with the "
      "new alignment, and {:.2f} with that of the files. {}",
      beads.num_beads, beads.is_accepted ? beads.after_px : beads.before_px, beads.files_px,
      beads.is_accepted ? fmt::format("It was {:.2f} before the beads were used", beads.before_px)
                        : "They do not improve it, so they were not used"));
}

// Says what the views tell about the specimen's pose. Nothing of it is applied.
void log_pose(const alignment::FoundPose& found) {
  base::log_info(fmt::format(
      "the specimen seems to be {:.0f} ± {:.0f} pixels thick and to have a pitch of "
      "{:.1f} ± {:.1f}° against the tilt angles, and of {:.1f} ± {:.1f}° about X; noisy views give "
      "rough values, so look at the XZ plane before you apply them (--thickness; export --level "
      "found)",
      found.pose.thickness_px, found.error.thickness_px, found.pose.pitch_deg,
      found.error.pitch_deg, found.pose.x_tilt_deg, found.error.x_tilt_deg));
}

void log_alignment(const alignment::AlignmentRecord& record) {
  double squares = 0.0;
  std::vector<std::int64_t> left_out;
  for (const alignment::AlignedView& view : record.views) {
    if (view.is_left_out)
      left_out.push_back(view.section + 1);
    else
      squares += std::pow(view.shift_px[0], 2) + std::pow(view.shift_px[1], 2);
  }
  const auto num_aligned = static_cast<double>(record.views.size() - left_out.size());
  const std::string errors = describe_errors(record.held_out);
  if (record.is_accepted) {
    base::log_info(fmt::format("aligned: shifts of {:.2f} pixels (root mean square){}{}{}; {}",
                               std::sqrt(squares / 2 / std::max(num_aligned, 1.0)),
                               record.freedoms.rotation ? ", rotations" : "",
                               record.freedoms.magnification ? ", magnifications" : "",
                               record.freedoms.tilt ? ", tilt angles" : "", errors));
  } else {
    base::log_info("the alignment stays as it was, since a new one is no better: " + errors);
  }
  if (record.beads) log_beads(*record.beads);
  if (record.pose)
    log_pose(*record.pose);
  else
    base::log_info("the views do not tell how thick the specimen is, nor its pitch");
  if (record.local) log_local_motion(*record.local);
  if (!left_out.empty())
    base::log_warning(fmt::format("left out, since they do not resemble the specimen: sections {}",
                                  fmt::join(left_out, ", ")));
}

// Says so if beads were found and the alignment could not follow them.
void log_unused_beads(const tilt_series::MaskMetrics& masks) {
  if (masks.num_beads == 0) return;
  base::log_info(fmt::format(
      "{} beads were found, and the alignment uses none of them: fewer than three have precise "
      "places in enough of the views, as happens where the views are binned so much that a bead "
      "has few pixels",
      masks.num_beads));
}

// Aligns the views of a series that is not resampled.
alignment::Alignment align_views(const tilt_series::TiltSeries& series,
                                 const options::ReconstructOptions& options,
                                 const tune::TuneHooks& hooks,
                                 const distributed::Communicator& processes) {
  // The views count as plain projections: fits with contrast transfer would need many more epochs
  // to show the specimen (docs/alignment.md).
  const alignment::JointProblem problem{
      .recorded = series,
      .plan = measurement::plan_realigned(series, options.specimen, processes),
      .field = options.field,
      .seed = options.fit.seed,
      .scratch_dir = options.input().scratch_dir,
      .progress = hooks.progress,
      .stop_requested = hooks.stop_requested};
  std::vector<geometry::ViewCorrection> start(series.views().size());
  if (options.run.align == Alignment::kFull)
    start = alignment::with_best_axis(problem, alignment::correlated_start(problem), processes);
  alignment::Alignment found = alignment::refine_alignment(problem, std::move(start), processes);
  if (!found.beads) log_unused_beads(series.mask_metrics());
  return found;
}

// Returns the input of an alignment: the views as they were recorded.
tilt_series::TiltSeriesOptions recorded_input(const options::ReconstructOptions& options) {
  tilt_series::TiltSeriesOptions recorded = options.input();
  recorded.resample = false;
  recorded.even.reset();
  return recorded;
}

// Aligns the series.
alignment::AlignmentRecord align_series(const options::ReconstructOptions& options,
                                        const alignment::AlignmentOrigin& origin,
                                        const tune::TuneHooks& hooks,
                                        const distributed::Communicator& processes) {
  const base::TraceSpan span("align series");
  const base::Stopwatch running;
  tilt_series::TiltSeriesOptions recorded = recorded_input(options);
  const tilt_series::TiltSeries series(recorded, processes);
  alignment::require_views(series.views().size());
  const alignment::Alignment found = align_views(series, options, hooks, processes);
  const bool is_clean = found.unaligned.empty();
  if (is_clean || options.run.align != Alignment::kFull ||
      series.views().size() - found.unaligned.size() < alignment::kFewestViews)
    return alignment::make_record(origin, series, found, running.seconds());

  // Views at wrong places mislead the search for the tilt axis, so the others are aligned again.
  for (const int view : found.unaligned)
    recorded.left_out.push_back(series.views()[static_cast<std::size_t>(view)].section);
  std::ranges::sort(recorded.left_out);
  base::log_info(fmt::format("{} views do not resemble the specimen: the others are aligned again",
                             found.unaligned.size()));
  const tilt_series::TiltSeries others(recorded, processes);
  const alignment::Alignment again = align_views(others, options, hooks, processes);
  if (!again.is_accepted) return alignment::make_record(origin, series, found, running.seconds());
  alignment::AlignmentRecord record =
      alignment::make_record(origin, others, again, running.seconds());
  alignment::add_left_out(series, found, record);
  return record;
}

// Returns the sections of the views that an alignment of the series has.
std::vector<std::int64_t> sections_of(const options::ReconstructOptions& options,
                                      const distributed::Communicator& processes) {
  const tilt_series::PlannedSeries series(recorded_input(options), processes);
  std::vector<std::int64_t> sections;
  for (const tilt_series::View& view : series.views()) sections.push_back(view.section);
  return sections;
}

}  // namespace

bool align_series(options::ReconstructOptions& options, const tune::TuneHooks& hooks,
                  const distributed::Communicator& processes) {
  if (options.run.align == Alignment::kOff) return true;
  const std::filesystem::path path = output::output_paths(options.run.output).alignment;
  alignment::AlignmentOrigin origin;
  alignment::AlignmentRecord record;
  processes.run_collectively([&] { origin = alignment_origin(options); });
  if (options.run.resume && std::filesystem::exists(path)) {
    const std::vector<std::int64_t> sections = sections_of(options, processes);
    processes.run_collectively([&] { record = read_alignment_record(path, origin, sections); });
  } else {
    try {
      record = align_series(options, origin, hooks, processes);
    } catch (const base::StopRequested&) {
      return false;
    }
    processes.run_collectively([&] {
      if (processes.is_root() && !options.run.output.empty()) alignment::write_record(path, record);
    });
  }
  apply_alignment(record, options);
  log_alignment(record);
  if (options.run.align == Alignment::kFull && !record.is_accepted) {
    base::log_warning(
        "the views are as good as not aligned, since no alignment predicted views better than "
        "none: check --tilt-axis and --thickness, or align them with another program");
  }
  return true;
}

}  // namespace tomofield::realign
