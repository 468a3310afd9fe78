#include "align/alignment_record.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <utility>

#include "base/plausible.h"
#include "io/json.h"
#include "tomofield/error.h"

namespace tomofield::alignment {
namespace {

using nlohmann::json;

constexpr double kRadian_deg = 180.0 / std::numbers::pi;

// ------------------------------------------------------------------ making

AlignedView aligned_view(const tilt_series::View& view, const geometry::ViewCorrection& correction,
                         const ViewAgreement& agreement, bool is_left_out) {
  return {.section = view.section,
          .tilt_deg = view.tilt_deg,
          .shift_px = {correction.shift_x_px, correction.shift_y_px},
          .rotation_deg = correction.rotation_rad * kRadian_deg,
          .log_magnification = correction.log_magnification,
          .tilt_change_deg = correction.tilt_deg,
          .local = correction.local,
          .agreement = agreement,
          .is_left_out = is_left_out};
}

LocalRecord local_record(const Alignment& found) {
  LocalRecord local{.trial = *found.local};
  if (!found.local->is_accepted) return local;
  double squares = 0.0;
  for (const geometry::ViewCorrection& view : found.corrections)
    squares += view.local->mean_square();
  const geometry::ViewWarp& motion = *found.corrections.front().local;
  local.size_px = {motion.width_px, motion.height_px};
  local.rms_px = std::sqrt(squares / static_cast<double>(found.corrections.size()));
  return local;
}

// ----------------------------------------------------------------- writing

json gain_json(const base::MeanGain& gain) {
  return {{"mean", gain.mean}, {"standard_error", gain.error}};
}

void write_comparison(const Comparison& held_out, json& object) {
  object["held_out_error"] = {{"before", held_out.before}, {"after", held_out.after}};
  object["gain"] = gain_json(held_out.gain);
}

json local_json(const LocalRecord& local) {
  json object = {{"accepted", local.trial.is_accepted}, {"steps_px", local.trial.steps_px}};
  write_comparison(local.trial.held_out, object);
  if (!local.trial.is_accepted) return object;
  object["size_px"] = local.size_px;
  object["rms_px"] = local.rms_px;
  return object;
}

json pose_json(const FoundPose& found) {
  return {
      {"pitch_deg", found.pose.pitch_deg},       {"pitch_error_deg", found.error.pitch_deg},
      {"x_tilt_deg", found.pose.x_tilt_deg},     {"x_tilt_error_deg", found.error.x_tilt_deg},
      {"thickness_px", found.pose.thickness_px}, {"thickness_error_px", found.error.thickness_px}};
}

json beads_json(const BeadRecord& beads) {
  return {{"beads", beads.num_beads},
          {"distance_px",
           {{"files", beads.files_px}, {"before", beads.before_px}, {"after", beads.after_px}}},
          {"gain", gain_json(beads.gain)},
          {"accepted", beads.is_accepted}};
}

json view_json(const AlignedView& view) {
  json object = {{"section", view.section + 1},
                 {"tilt_deg", view.tilt_deg},
                 {"shift_px", view.shift_px},
                 {"rotation_deg", view.rotation_deg},
                 {"log_magnification", view.log_magnification},
                 {"tilt_change_deg", view.tilt_change_deg},
                 {"correlation", view.agreement.correlation},
                 {"shift_error_px", view.agreement.error_px},
                 {"left_out", view.is_left_out}};
  if (view.local) object["local_px"] = view.local->rows();
  return object;
}

json series_json(const AlignmentOrigin& origin) {
  return {{"sections", origin.num_sections},
          {"size_px", origin.size_px},
          {"files", origin.files},
          {"header_tilts", origin.header_tilts},
          {"pixels", origin.pixels}};
}

std::string size_text(const AlignmentOrigin& series) {
  return fmt::format("{} sections of {} × {} pixels", series.num_sections, series.size_px[0],
                     series.size_px[1]);
}

// ----------------------------------------------------------------- reading

// Returns the part of an object under `key`.
const json& part(const json& object, const char* key) {
  if (!object.is_object() || !object.contains(key))
    throw Error(fmt::format("there is no '{}'", key));
  return object.at(key);
}

bool flag_at(const json& object, const char* key) {
  const json& value = part(object, key);
  if (!value.is_boolean()) throw Error(fmt::format("'{}' is neither true nor false", key));
  return value.get<bool>();
}

std::string text_at(const json& object, const char* key) {
  const json& value = part(object, key);
  if (!value.is_string()) throw Error(fmt::format("'{}' is no text", key));
  return value.get<std::string>();
}

constexpr double kLargestTilt_deg = 90.0;

double number_at(const json& object, const char* key) {
  return io::number_at(object, key, -base::kLargestNumber, base::kLargestNumber);
}

// Returns two numbers: of x and y, or a width and a height.
std::array<double, 2> pair_at(const json& object, const char* key, double low, double high) {
  const std::vector<double> numbers = io::numbers_at(object, key, low, high);
  if (numbers.size() != 2)
    throw Error(fmt::format("'{}' has {} numbers, not 2", key, numbers.size()));
  return {numbers[0], numbers[1]};
}

std::array<double, 2> positions_at(const json& object, const char* key) {
  return pair_at(object, key, -base::kLargestPosition_px, base::kLargestPosition_px);
}

base::MeanGain gain_at(const json& object) {
  const json& gain = part(object, "gain");
  return {.mean = number_at(gain, "mean"), .error = number_at(gain, "standard_error")};
}

Comparison comparison_from(const json& object) {
  const json& errors = part(object, "held_out_error");
  return {.before = number_at(errors, "before"),
          .after = number_at(errors, "after"),
          .gain = gain_at(object)};
}

std::vector<double> steps_at(const json& object) {
  return io::numbers_at(object, "steps_px", 0, base::kLargestNumber);
}

BeadRecord beads_from(const json& object) {
  const json& distance_px = part(object, "distance_px");
  return {.num_beads = io::integer_at(object, "beads", 0, 1 << 30),
          .files_px = number_at(distance_px, "files"),
          .before_px = number_at(distance_px, "before"),
          .after_px = number_at(distance_px, "after"),
          .gain = gain_at(object),
          .is_accepted = flag_at(object, "accepted")};
}

LocalRecord local_from(const json& object) {
  LocalRecord local{.trial = {.held_out = comparison_from(object),
                              .steps_px = steps_at(object),
                              .is_accepted = flag_at(object, "accepted")}};
  if (!local.trial.is_accepted) return local;
  local.size_px = pair_at(object, "size_px", 1, base::kLargestPosition_px);
  local.rms_px = number_at(object, "rms_px");
  return local;
}

FoundPose pose_from(const json& object) {
  constexpr double kThinnest_px = 0.01;
  const auto angle_at = [&](const char* key) {
    return io::number_at(object, key, -kLargestTilt_deg, kLargestTilt_deg);
  };
  const auto error_at = [&](const char* key) {
    return io::number_at(object, key, 0, base::kLargestNumber);
  };
  FoundPose found;
  found.pose = {.thickness_px =
                    io::number_at(object, "thickness_px", kThinnest_px, base::kLargestPosition_px),
                .pitch_deg = angle_at("pitch_deg"),
                .x_tilt_deg = angle_at("x_tilt_deg")};
  found.error = {.thickness_px = error_at("thickness_error_px"),
                 .pitch_deg = error_at("pitch_error_deg"),
                 .x_tilt_deg = error_at("x_tilt_error_deg")};
  return found;
}

geometry::ViewWarp motion_from(const json& rows, const std::optional<LocalRecord>& local) {
  const auto is_node = [](const json& node) {
    return node.is_array() && node.size() == 2 && std::ranges::all_of(node, [](const json& of) {
             return of.is_number() &&
                    base::is_plausible(of.get<double>(), base::kLargestPosition_px);
           });
  };
  const auto is_row = [&](const json& row) {
    return row.is_array() && row.size() == geometry::ViewWarp::kNodes &&
           std::ranges::all_of(row, is_node);
  };
  if (!rows.is_array() || rows.size() != geometry::ViewWarp::kNodes ||
      !std::ranges::all_of(rows, is_row))
    throw Error(fmt::format("'local_px' is not {0} rows of {0} displacements",
                            static_cast<int>(geometry::ViewWarp::kNodes)));
  if (!local || !local->trial.is_accepted) throw Error("'local' was not accepted");
  return geometry::ViewWarp::from_rows(local->size_px[0], local->size_px[1],
                                       rows.get<geometry::ViewWarp::Rows>());
}

AlignedView view_from(const json& object, const std::optional<LocalRecord>& local) {
  constexpr double kLargestLog = 1.0, kLargestTiltChange_deg = 30.0;
  AlignedView view{
      .tilt_deg = io::number_at(object, "tilt_deg", -kLargestTilt_deg, kLargestTilt_deg),
      .shift_px = positions_at(object, "shift_px"),
      .rotation_deg =
          io::number_at(object, "rotation_deg", -base::kLargestAngle_deg, base::kLargestAngle_deg),
      .log_magnification = io::number_at(object, "log_magnification", -kLargestLog, kLargestLog),
      .tilt_change_deg =
          io::number_at(object, "tilt_change_deg", -kLargestTiltChange_deg, kLargestTiltChange_deg),
      .agreement = {.correlation = number_at(object, "correlation"),
                    .error_px = positions_at(object, "shift_error_px")},
      .is_left_out = flag_at(object, "left_out")};
  if (object.contains("local_px")) view.local = motion_from(part(object, "local_px"), local);
  return view;
}

std::vector<AlignedView> views_from(const json& views, const AlignmentRecord& record) {
  if (!views.is_array() || views.empty()) throw Error("it has no 'views'");
  std::vector<AlignedView> all;
  std::int64_t previous = 0;
  for (const json& view : views) {
    previous = io::integer_at(view, "section", previous + 1, record.origin.num_sections);
    all.push_back(view_from(view, record.local));
    all.back().section = previous - 1;
  }
  return all;
}

}  // namespace

geometry::ViewCorrection AlignedView::correction() const {
  return {.shift_x_px = shift_px[0],
          .shift_y_px = shift_px[1],
          .rotation_rad = rotation_deg / kRadian_deg,
          .log_magnification = log_magnification,
          .tilt_deg = tilt_change_deg,
          .local = local};
}

AlignmentRecord make_record(AlignmentOrigin origin, const tilt_series::PlannedSeries& series,
                            const Alignment& found, double seconds) {
  AlignmentRecord record{.origin = std::move(origin),
                         .is_accepted = found.is_accepted,
                         .freedoms = found.joint.freedoms,
                         .held_out = found.held_out,
                         .steps_px = found.joint.steps_px,
                         .seconds = seconds,
                         .pose = found.joint.pose,
                         .beads = {},
                         .local = {},
                         .views = {}};
  if (const auto& beads = found.beads)
    record.beads = BeadRecord{static_cast<std::int64_t>(beads->num_beads),
                              beads->files_px,
                              beads->before_px,
                              beads->after_px,
                              beads->gain,
                              beads->is_accepted};
  if (found.local) record.local = local_record(found);
  for (std::size_t v = 0; v < series.views().size(); ++v) {
    // An alignment that was not accepted says nothing against a view.
    const bool is_left_out =
        found.is_accepted && std::ranges::binary_search(found.unaligned, static_cast<int>(v));
    record.views.push_back(aligned_view(series.views()[v], found.corrections[v],
                                        found.joint.agreement[v], is_left_out));
  }
  return record;
}

void add_left_out(const tilt_series::PlannedSeries& series, const Alignment& first,
                  AlignmentRecord& record) {
  for (const int view : first.unaligned) {
    const auto at = static_cast<std::size_t>(view);
    record.views.push_back(
        aligned_view(series.views()[at], {}, first.joint.agreement[at], /*is_left_out=*/true));
  }
  std::ranges::stable_sort(record.views, {}, &AlignedView::section);
}

json to_json(const AlignmentOrigin& origin) {
  return {{"made_with", origin.made_with}, {"series", series_json(origin)}};
}

AlignmentOrigin origin_from(const json& json) {
  constexpr double kLargestSize_px = 1 << 30;
  const auto& series = part(json, "series");
  const std::array<double, 2> size_px = pair_at(series, "size_px", 1, kLargestSize_px);
  AlignmentOrigin origin{
      .num_sections = io::integer_at(series, "sections", 1, 1 << 30),
      .size_px = {static_cast<std::int64_t>(size_px[0]), static_cast<std::int64_t>(size_px[1])},
      .files = {},
      .header_tilts = text_at(series, "header_tilts"),
      .pixels = text_at(series, "pixels"),
      .made_with = part(json, "made_with")};
  const auto& files = part(series, "files");
  if (!files.is_object()) throw Error("'files' is no object");
  for (const auto& file : files.items())
    origin.files[file.key()] = text_at(files, file.key().c_str());
  return origin;
}

std::string text_of(const AlignmentOrigin& origin) { return to_json(origin).dump(); }

AlignmentOrigin origin_from_text(const std::string& text) {
  return origin_from(io::parse_json(text));
}

std::string difference_of(const AlignmentOrigin& found, const AlignmentOrigin& wanted) {
  if (size_text(found) != size_text(wanted))
    return fmt::format("it is of a series of {}, and this one has {}", size_text(found),
                       size_text(wanted));
  AlignmentOrigin series = found;
  series.made_with = wanted.made_with;
  if (series != wanted)
    return "it was made from another series: its images or its files are not the same";
  return found.made_with != wanted.made_with ? "it was made with other options" : "";
}

json to_json(const AlignmentRecord& record) {
  json views = json::array();
  for (const AlignedView& view : record.views) views.push_back(view_json(view));
  json object = to_json(record.origin);
  object.update({{"accepted", record.is_accepted},
                 {"rotation", record.freedoms.rotation},
                 {"magnification", record.freedoms.magnification},
                 {"tilt", record.freedoms.tilt},
                 {"steps_px", record.steps_px},
                 {"seconds", record.seconds},
                 {"views", std::move(views)}});
  write_comparison(record.held_out, object);
  if (record.pose) object["pose"] = pose_json(*record.pose);
  if (record.beads) object["beads"] = beads_json(*record.beads);
  if (record.local) object["local"] = local_json(*record.local);
  return object;
}

AlignmentRecord record_from(const json& object) {
  AlignmentRecord record{.origin = origin_from(object),
                         .is_accepted = flag_at(object, "accepted"),
                         .freedoms = {.rotation = flag_at(object, "rotation"),
                                      .magnification = flag_at(object, "magnification"),
                                      .tilt = flag_at(object, "tilt")},
                         .held_out = comparison_from(object),
                         .steps_px = steps_at(object),
                         .seconds = io::number_at(object, "seconds", 0, base::kLargestNumber),
                         .pose = {},
                         .beads = {},
                         .local = {},
                         .views = {}};
  if (object.contains("pose")) record.pose = pose_from(object.at("pose"));
  if (object.contains("beads")) record.beads = beads_from(object.at("beads"));
  if (object.contains("local")) record.local = local_from(object.at("local"));
  record.views = views_from(part(object, "views"), record);
  return record;
}

void write_record(const std::filesystem::path& file, const AlignmentRecord& record) {
  io::write_json(file, to_json(record));
}

AlignmentRecord read_record(const std::filesystem::path& file) {
  return io::read_record(file, record_from, [](const std::string& why) { return why; });
}

}  // namespace tomofield::alignment
