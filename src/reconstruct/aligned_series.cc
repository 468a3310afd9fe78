#include "reconstruct/aligned_series.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>
#include <numbers>
#include <string>
#include <utility>
#include <vector>

#include "align/alignment.h"
#include "align/axis_search.h"
#include "base/log.h"
#include "base/stop_requested.h"
#include "base/stopwatch.h"
#include "base/trace.h"
#include "io/json.h"
#include "measurement/prepare.h"
#include "measurement/view_transfers.h"
#include "tilt_series/tilt_series.h"
#include "tomofield/error.h"

namespace tomofield::reconstruction {
namespace {

using nlohmann::json;

constexpr double kRadian_deg = 180.0 / std::numbers::pi;
constexpr std::size_t kFewestViews = 12;

// Returns the options that decide what the alignment finds.
json relevant_options(const ReconstructOptions& options) {
  const json all = options_json(options);
  return {{"input", all["input"]}, {"specimen", all["specimen"]}, {"seed", options.fit.seed}};
}

json held_out_json(const align::Comparison& held_out) {
  return {{"held_out_error", {{"before", held_out.before}, {"after", held_out.after}}},
          {"gain", {{"mean", held_out.gain.mean}, {"standard_error", held_out.gain.error}}}};
}

json local_trial_json(const align::Alignment& found) {
  json trial = held_out_json(found.local->held_out);
  trial["accepted"] = found.local->is_accepted;
  trial["steps_px"] = found.local->steps_px;
  if (!found.local->is_accepted) return trial;
  double squares = 0.0;
  for (const geometry::ViewCorrection& view : found.corrections)
    squares += view.local->mean_square();
  const geometry::ViewWarp& motion = *found.corrections.front().local;
  trial["size_px"] = {motion.width_px, motion.height_px};
  trial["rms_px"] = std::sqrt(squares / static_cast<double>(found.corrections.size()));
  return trial;
}

json pose_json(const align::FoundPose& found) {
  return {{"pitch_deg", found.pose.pitch_deg},
          {"pitch_error_deg", found.error.pitch_deg},
          {"thickness_px", found.pose.thickness_px},
          {"thickness_error_px", found.error.thickness_px}};
}

json beads_json(const align::BeadAlignment& beads) {
  return {{"beads", beads.num_beads},
          {"distance_px",
           {{"files", beads.files_px}, {"before", beads.before_px}, {"after", beads.after_px}}},
          {"gain", {{"mean", beads.gain.mean}, {"standard_error", beads.gain.error}}},
          {"accepted", beads.is_accepted}};
}

json view_json(const tilt_series::View& view, const geometry::ViewCorrection& correction,
               const align::ViewAgreement& agreement, bool is_unaligned) {
  json result = {{"section", view.section + 1},
                 {"tilt_deg", view.tilt_deg},
                 {"shift_px", {correction.shift_x_px, correction.shift_y_px}},
                 {"rotation_deg", correction.rotation_rad * kRadian_deg},
                 {"log_magnification", correction.log_magnification},
                 {"tilt_change_deg", correction.tilt_deg},
                 {"correlation", agreement.correlation},
                 {"shift_error_px", agreement.error_px},
                 {"left_out", is_unaligned}};
  if (correction.local) result["local_px"] = correction.local->rows();
  return result;
}

json record_of(const tilt_series::TiltSeries& series, const align::Alignment& found,
               const ReconstructOptions& options, double seconds) {
  json views = json::array();
  for (std::size_t v = 0; v < series.views().size(); ++v) {
    views.push_back(view_json(series.views()[v], found.corrections[v], found.joint.agreement[v],
                              std::ranges::binary_search(found.unaligned, static_cast<int>(v))));
  }
  json record = {{"made_with", relevant_options(options)},
                 {"accepted", found.is_accepted},
                 {"rotation", found.joint.freedoms.rotation},
                 {"magnification", found.joint.freedoms.magnification},
                 {"tilt", found.joint.freedoms.tilt},
                 {"steps_px", found.joint.steps_px},
                 {"seconds", seconds},
                 {"views", std::move(views)}};
  record.update(held_out_json(found.held_out));
  if (found.joint.pose) record["pose"] = pose_json(*found.joint.pose);
  if (found.beads) record["beads"] = beads_json(*found.beads);
  if (found.local) record["local"] = local_trial_json(found);
  return record;
}

// Reads the record of an earlier run of the same options.
json read_record(const std::filesystem::path& path, const ReconstructOptions& options) {
  const auto refuse = [&](const char* why) {
    throw Error(
        fmt::format("cannot resume: the alignment '{}' {}; to start over, give --overwrite "
                    "instead of --resume",
                    path.string(), why));
  };
  json record = json::parse(std::ifstream(path), nullptr, false);
  if (!record.is_object() || !record.contains("made_with") || !record.contains("views"))
    refuse("is damaged");
  if (record["made_with"] != relevant_options(options)) refuse("was made with other options");
  return record;
}

// Puts the corrections of a record into the options.
void apply_record(const json& record, ReconstructOptions& options) {
  std::int64_t num_sections = 0;
  for (const json& view : record["views"])
    num_sections = std::max(num_sections, view["section"].get<std::int64_t>());
  auto& corrections = options.input.corrections;
  corrections.assign(static_cast<std::size_t>(num_sections), {});
  for (const json& view : record["views"]) {
    const auto section = view["section"].get<std::int64_t>() - 1;
    corrections[static_cast<std::size_t>(section)] = {
        .shift_x_px = view["shift_px"][0],
        .shift_y_px = view["shift_px"][1],
        .rotation_rad = view["rotation_deg"].get<double>() / kRadian_deg,
        .log_magnification = view["log_magnification"],
        .tilt_deg = view["tilt_change_deg"]};
    if (view.contains("local_px")) {
      const json& size_px = record.at("local").at("size_px");
      corrections[static_cast<std::size_t>(section)].local =
          geometry::ViewWarp::from_rows(size_px.at(0), size_px.at(1), view["local_px"]);
    }
    if (view["left_out"].get<bool>()) options.input.left_out.push_back(section);
  }
  options.alignment = record;
}

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
  base::log_info(
      fmt::format("the specimen is {:.0f} ± {:.0f} pixels thick and has a pitch of {:.1f} ± "
                  "{:.1f}° against the "
                  "tilt angles (--thickness and --tilt-offset apply them)",
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
                             const ReconstructOptions& options, const ReconstructHooks& hooks,
                             const distributed::Communicator& processes) {
  measurement::Measurement plan = measurement::plan_realigned(series, options.specimen, processes);
  processes.run_collectively([&] {
    plan.transfers =
        measurement::view_transfers(options.files, options.resolved, options.input, series);
  });
  const align::JointProblem problem{.recorded = series,
                                    .plan = std::move(plan),
                                    .field = options.field,
                                    .seed = options.fit.seed,
                                    .scratch_dir = options.input.scratch_dir,
                                    .progress = hooks.tune_progress,
                                    .stop_requested = hooks.stop_requested};
  std::vector<geometry::ViewCorrection> start(series.views().size());
  if (options.resolved.align == Alignment::kFull)
    start = align::with_best_axis(problem, align::correlated_start(problem), processes);
  align::Alignment found = align::refine_alignment(problem, std::move(start), processes);
  if (!found.beads) log_unused_beads(series.mask_metrics());
  return found;
}

// Adds views that are left out to the record of the others.
void add_left_out(const json& views, json& record) {
  for (const json& view : views) record["views"].push_back(view);
  std::ranges::stable_sort(record["views"].get_ref<json::array_t&>(), {},
                           [](const json& view) { return view["section"].get<std::int64_t>(); });
}

// Aligns the series.
json make_record(const ReconstructOptions& options, const ReconstructHooks& hooks,
                 const distributed::Communicator& processes) {
  const base::TraceSpan span("align series");
  const base::Stopwatch running;
  tilt_series::TiltSeriesOptions recorded = options.input;
  recorded.resample = false;
  recorded.halves.reset();
  const tilt_series::TiltSeries series(recorded, processes);
  if (series.views().size() < kFewestViews)
    throw Error(
        fmt::format("--align needs at least {} views, since it judges the alignment by "
                    "views that it holds out; '{}' has {}",
                    kFewestViews, recorded.stack.string(), series.views().size()));
  const align::Alignment found = align_views(series, options, hooks, processes);
  const bool is_clean = found.unaligned.empty();
  if (is_clean || options.resolved.align != Alignment::kFull ||
      series.views().size() - found.unaligned.size() < kFewestViews)
    return record_of(series, found, options, running.seconds());

  // Views at wrong places mislead the search for the tilt axis, so the others are aligned anew.
  json left_out = json::array();
  for (const int view : found.unaligned) {
    const auto at = static_cast<std::size_t>(view);
    left_out.push_back(view_json(series.views()[at], {}, found.joint.agreement[at], true));
    recorded.left_out.push_back(series.views()[at].section);
  }
  std::ranges::sort(recorded.left_out);
  base::log_info(fmt::format("{} views do not resemble the specimen: the others are aligned again",
                             found.unaligned.size()));
  const tilt_series::TiltSeries others(recorded, processes);
  const align::Alignment again = align_views(others, options, hooks, processes);
  json record = record_of(others, again, options, running.seconds());
  add_left_out(left_out, record);
  return record;
}

}  // namespace

bool align_series(ReconstructOptions& options, const ReconstructHooks& hooks,
                  const distributed::Communicator& processes) {
  if (options.resolved.align == Alignment::kOff) return true;
  const std::filesystem::path path = output_paths(options.resolved.output).alignment;
  json record;
  if (options.resolved.resume && std::filesystem::exists(path)) {
    processes.run_collectively([&] { record = read_record(path, options); });
  } else {
    try {
      record = make_record(options, hooks, processes);
    } catch (const base::StopRequested&) {
      return false;
    }
    processes.run_collectively([&] {
      if (processes.is_root() && !options.resolved.output.empty()) io::write_json(path, record);
    });
  }
  apply_record(record, options);
  log_alignment(record);
  return true;
}

}  // namespace tomofield::reconstruction
