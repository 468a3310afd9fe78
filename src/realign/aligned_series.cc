#include "realign/aligned_series.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <string>
#include <utility>
#include <vector>

#include "align/alignment.h"
#include "align/start/axis_search.h"
#include "base/log.h"
#include "base/stop_requested.h"
#include "base/stopwatch.h"
#include "base/trace.h"
#include "io/json.h"
#include "measurement/prepare.h"
#include "output/output_paths.h"
#include "realign/alignment_record.h"
#include "tilt_series/tilt_series.h"

namespace tomofield::realign {
namespace {

using nlohmann::json;

std::string describe_errors(const json& compared) {
  return fmt::format(
      "held-out views are predicted with an error of {:.4f} (before: {:.4f}; the difference is "
      "known to {:.4f})",
      compared["held_out_error"]["after"].get<double>(),
      compared["held_out_error"]["before"].get<double>(),
      compared["gain"]["standard_error"].get<double>());
}

void log_local_motion(const json& local) {
  const std::string errors = describe_errors(local);
  if (local["accepted"].get<bool>()) {
    base::log_info(fmt::format(
        "undone: local motion of {:.2f} pixels (root mean square), which .xf and .aln files cannot "
        "hold; {}",
        local["rms_px"].get<double>(), errors));
  } else {
    base::log_info(
        "local motion that the views seem to have is not undone, since they are not sure to be "
        "predicted better: " +
        errors);
  }
}

// Says how well gold beads keep their places.
void log_beads(const json& beads) {
  const json& distance_px = beads["distance_px"];
  const bool is_used = beads["accepted"].get<bool>();
  base::log_info(fmt::format(
      "{} gold beads lie {:.2f} pixels (root mean square in x and y) from their places with the "
      "new alignment, and {:.2f} with that of the files. {}",
      beads["beads"].get<int>(), distance_px[is_used ? "after" : "before"].get<double>(),
      distance_px["files"].get<double>(),
      is_used ? fmt::format("It was {:.2f} before the beads were used",
                            distance_px["before"].get<double>())
              : "They do not improve it, so they were not used"));
}

// Says what the views tell about the specimen's pose. Nothing of it is applied.
void log_pose(const json& pose) {
  base::log_info(fmt::format(
      "the specimen seems to be {:.0f} ± {:.0f} pixels thick and to have a pitch of "
      "{:.1f} ± {:.1f}° against the tilt angles; noisy views give rough values, so look "
      "at the XZ plane before you apply them (--thickness, --tilt-offset)",
      pose["thickness_px"].get<double>(), pose["thickness_error_px"].get<double>(),
      pose["pitch_deg"].get<double>(), pose["pitch_error_deg"].get<double>()));
}

void log_alignment(const json& record) {
  double squares = 0.0;
  std::vector<std::string> left_out;
  double num_aligned = 0.0;
  for (const json& view : record["views"]) {
    if (view["left_out"].get<bool>()) {
      left_out.push_back(fmt::format("{}", view["section"].get<int>()));
      continue;
    }
    num_aligned += 1.0;
    squares += std::pow(view["shift_px"][0].get<double>(), 2) +
               std::pow(view["shift_px"][1].get<double>(), 2);
  }
  const std::string errors = describe_errors(record);
  if (record["accepted"].get<bool>()) {
    base::log_info(fmt::format("aligned: shifts of {:.2f} pixels (root mean square){}{}{}; {}",
                               std::sqrt(squares / 2 / std::max(num_aligned, 1.0)),
                               record["rotation"].get<bool>() ? ", rotations" : "",
                               record["magnification"].get<bool>() ? ", magnifications" : "",
                               record["tilt"].get<bool>() ? ", tilt angles" : "", errors));
  } else {
    base::log_info("the alignment stays as it was, since a new one is no better: " + errors);
  }
  if (record.contains("beads")) log_beads(record["beads"]);
  if (record.contains("pose")) log_pose(record["pose"]);
  if (record.contains("local")) log_local_motion(record["local"]);
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
align::Alignment align_views(const tilt_series::TiltSeries& series,
                             const options::ReconstructOptions& options,
                             const tune::TuneHooks& hooks,
                             const distributed::Communicator& processes) {
  // The views count as plain projections: fits with contrast transfer would need many more epochs
  // to show the specimen (docs/alignment.md).
  const align::JointProblem problem{
      .recorded = series,
      .plan = measurement::plan_realigned(series, options.specimen, processes),
      .field = options.field,
      .seed = options.fit.seed,
      .scratch_dir = options.input().scratch_dir,
      .progress = hooks.progress,
      .stop_requested = hooks.stop_requested};
  std::vector<geometry::ViewCorrection> start(series.views().size());
  if (options.run.align == Alignment::kFull)
    start = align::with_best_axis(problem, align::correlated_start(problem), processes);
  align::Alignment found = align::refine_alignment(problem, std::move(start), processes);
  if (!found.beads) log_unused_beads(series.mask_metrics());
  return found;
}

// Aligns the series.
json make_record(const options::ReconstructOptions& options, const tune::TuneHooks& hooks,
                 const distributed::Communicator& processes) {
  const base::TraceSpan span("align series");
  const base::Stopwatch running;
  tilt_series::TiltSeriesOptions recorded = options.input();
  recorded.resample = false;
  recorded.even.reset();
  const tilt_series::TiltSeries series(recorded, processes);
  align::require_views(series.views().size());
  const align::Alignment found = align_views(series, options, hooks, processes);
  const bool is_clean = found.unaligned.empty();
  if (is_clean || options.run.align != Alignment::kFull ||
      series.views().size() - found.unaligned.size() < align::kFewestViews)
    return alignment_record(series, found, running.seconds());

  // Views at wrong places mislead the search for the tilt axis, so the others are aligned again.
  for (const int view : found.unaligned)
    recorded.left_out.push_back(series.views()[static_cast<std::size_t>(view)].section);
  std::ranges::sort(recorded.left_out);
  base::log_info(fmt::format("{} views do not resemble the specimen: the others are aligned again",
                             found.unaligned.size()));
  const tilt_series::TiltSeries others(recorded, processes);
  const align::Alignment again = align_views(others, options, hooks, processes);
  if (!again.is_accepted) return alignment_record(series, found, running.seconds());
  json record = alignment_record(others, again, running.seconds());
  add_left_out(series, found, record);
  return record;
}

}  // namespace

bool align_series(options::ReconstructOptions& options, const tune::TuneHooks& hooks,
                  const distributed::Communicator& processes) {
  if (options.run.align == Alignment::kOff) return true;
  const std::filesystem::path path = output::output_paths(options.run.output).alignment;
  json origin, record;
  processes.run_collectively([&] { origin = alignment_origin(options); });
  if (options.run.resume && std::filesystem::exists(path)) {
    processes.run_collectively([&] { record = read_alignment_record(path, origin); });
  } else {
    try {
      record = make_record(options, hooks, processes);
    } catch (const base::StopRequested&) {
      return false;
    }
    record.update(origin);
    processes.run_collectively([&] {
      if (processes.is_root() && !options.run.output.empty()) io::write_json(path, record);
    });
  }
  apply_alignment(record, options);
  log_alignment(record);
  return true;
}

}  // namespace tomofield::realign
