#include "realign/alignment_record.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <exception>
#include <memory>
#include <numbers>
#include <optional>
#include <set>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "base/plausible.h"
#include "base/xxhash64.h"
#include "geometry/view_warp.h"
#include "io/images/image_stack.h"
#include "io/json_numbers.h"
#include "io/tables/alignment_files.h"
#include "io/tables/text_lines.h"
#include "io/tables/view_table.h"
#include "measurement/view_transfers.h"
#include "tilt_series/open_views.h"
#include "tomofield/error.h"

namespace tomofield::realign {
namespace {

using nlohmann::json;

constexpr double kRadian_deg = 180.0 / std::numbers::pi;

// ------------------------------------------------------------------- origin

std::string hex(std::uint64_t checksum) { return fmt::format("{:016x}", checksum); }

// Returns the small files that decide how the views are read and aligned, by their names in the
// options.
std::vector<std::pair<const char*, std::filesystem::path>> small_files(const SeriesFiles& files) {
  std::vector<std::pair<const char*, std::filesystem::path>> all;
  const auto add = [&](const char* name, const std::optional<std::filesystem::path>& file) {
    if (file) all.emplace_back(name, *file);
  };
  add("tlt", files.tlt);
  add("xf", files.xf);
  add("xtilt", files.xtilt);
  add("local", files.local);
  add("aln", files.aln);
  add("mdoc", files.mdoc);
  add("fiducials", files.fiducials);
  if (measurement::has_ctf_file(files)) add("ctf", files.ctf);
  add("mtf", files.mtf);
  if (!files.stack.empty() && io::is_view_table(files.stack)) add("stack", files.stack);
  return all;
}

json checksums_of_files(const SeriesFiles& files) {
  json sums = json::object();
  for (const auto& [name, file] : small_files(files)) {
    const std::string text = io::read_small_file(file);
    sums[name] = hex(base::xxhash64(std::as_bytes(std::span(text))));
  }
  return sums;
}

// Returns a checksum of the first, the middle and the last section that is used.
std::string checksum_of_pixels(const io::ImageStack& stack, const std::string& excluded) {
  const io::MrcHeader& header = stack.header();
  const auto unused = io::parse_section_list(excluded, header.nz);
  std::vector<std::int64_t> used;
  for (std::int64_t section = 0; section < header.nz; ++section)
    if (!std::ranges::binary_search(unused, section)) used.push_back(section);
  if (used.empty()) return hex(0);
  std::vector<float> image(static_cast<std::size_t>(header.nx * header.ny));
  base::Xxhash64 sum;
  for (const std::int64_t section : std::set{used.front(), used[used.size() / 2], used.back()}) {
    stack.read_section(section, image);
    sum.add(std::as_bytes(std::span(image)));
  }
  return hex(sum.value());
}

json series_json(const options::ReconstructOptions& options) {
  const auto stack = tilt_series::open_views(options.input());
  const io::MrcHeader& header = stack->header();
  const std::span tilts(header.extended_tilt_deg);
  return {{"sections", header.nz},
          {"size_px", {header.nx, header.ny}},
          {"files", checksums_of_files(options.files)},
          {"header_tilts", hex(base::xxhash64(std::as_bytes(tilts)))},
          {"pixels", checksum_of_pixels(*stack, options.views.exclude)}};
}

// Returns the options that decide what the alignment finds.
json relevant_options(const options::ReconstructOptions& options) {
  json all = options::options_json(options);
  json& input = all["input"];
  for (const char* unused : {"stack", "even", "odd"}) input.erase(unused);
  for (const auto& named : small_files(options.files)) input.erase(named.first);
  const FieldOptions field = align::planned_field(options.field);
  return {{"input", input},
          {"specimen", all["specimen"]},
          {"align", all["fit"]["align"]},
          {"seed", options.fit.seed},
          {"field",
           {{"with_margin", field.with_margin},
            {"margin_spacing", field.margin_spacing},
            {"vertex_spacing", field.vertex_spacing},
            {"activation", all["field"]["activation"]}}}};
}

// ------------------------------------------------------------------ writing

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

// ------------------------------------------------------------------ reading

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

void require_comparison(const json& compared) {
  for (const char* key : {"before", "after"}) number_at(part(compared, "held_out_error"), key);
  for (const char* key : {"mean", "standard_error"}) number_at(part(compared, "gain"), key);
}

void require_sound_beads(const json& beads) {
  io::integer_at(beads, "beads", 0, 1 << 30);
  for (const char* key : {"files", "before", "after"}) number_at(part(beads, "distance_px"), key);
  flag_at(beads, "accepted");
}

void require_sound_local(const json& local) {
  require_comparison(local);
  if (!flag_at(local, "accepted")) return;
  number_at(local, "rms_px");
  pair_at(local, "size_px", 1, base::kLargestPosition_px);
}

void require_sound_motion(const json& rows) {
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
}

void require_sound_view(const json& view, const json& record) {
  constexpr double kLargestLog = 1.0, kLargestTilt_deg = 90.0, kLargestTiltChange_deg = 30.0;
  positions_at(view, "shift_px");
  positions_at(view, "shift_error_px");
  io::number_at(view, "tilt_deg", -kLargestTilt_deg, kLargestTilt_deg);
  io::number_at(view, "rotation_deg", -base::kLargestAngle_deg, base::kLargestAngle_deg);
  io::number_at(view, "tilt_change_deg", -kLargestTiltChange_deg, kLargestTiltChange_deg);
  io::number_at(view, "log_magnification", -kLargestLog, kLargestLog);
  number_at(view, "correlation");
  flag_at(view, "left_out");
  if (!view.contains("local_px")) return;
  require_sound_motion(part(view, "local_px"));
  if (!flag_at(part(record, "local"), "accepted")) throw Error("'local' was not accepted");
}

// Refuses a record that no alignment of `num_sections` sections could have written.
void require_sound(const json& record, std::int64_t num_sections) {
  for (const char* flag : {"accepted", "rotation", "magnification", "tilt"}) flag_at(record, flag);
  require_comparison(record);
  if (record.contains("beads")) require_sound_beads(part(record, "beads"));
  if (record.contains("local")) require_sound_local(part(record, "local"));
  if (record.contains("pose")) {
    for (const char* key : {"pitch_deg", "pitch_error_deg", "thickness_px", "thickness_error_px"})
      number_at(part(record, "pose"), key);
  }
  const json& views = part(record, "views");
  if (!views.is_array() || views.empty()) throw Error("it has no 'views'");
  std::int64_t previous = 0;
  for (const json& view : views) {
    previous = io::integer_at(view, "section", previous + 1, num_sections);
    require_sound_view(view, record);
  }
}

std::string size_text(const json& series) {
  const std::array<double, 2> size = positions_at(series, "size_px");
  return fmt::format("{} sections of {} × {} pixels",
                     io::integer_at(series, "sections", 1, INT64_MAX), size[0], size[1]);
}

void require_origin(const json& record, const json& origin) {
  const json &found = part(record, "series"), &wanted = origin.at("series");
  if (size_text(found) != size_text(wanted))
    throw Error(fmt::format("it is of a series of {}, and this one has {}", size_text(found),
                            size_text(wanted)));
  if (found != wanted)
    throw Error("it was made from another series: its images or its files are not the same");
  if (part(record, "made_with") != origin.at("made_with"))
    throw Error("it was made with other options");
}

geometry::ViewCorrection correction_of(const json& view, const json& record) {
  geometry::ViewCorrection correction{
      .shift_x_px = view.at("shift_px").at(0),
      .shift_y_px = view.at("shift_px").at(1),
      .rotation_rad = view.at("rotation_deg").get<double>() / kRadian_deg,
      .log_magnification = view.at("log_magnification"),
      .tilt_deg = view.at("tilt_change_deg")};
  if (view.contains("local_px")) {
    const json& size_px = record.at("local").at("size_px");
    correction.local =
        geometry::ViewWarp::from_rows(size_px.at(0), size_px.at(1), view.at("local_px"));
  }
  return correction;
}

}  // namespace

json alignment_origin(const options::ReconstructOptions& options) {
  return {{"made_with", relevant_options(options)}, {"series", series_json(options)}};
}

json alignment_record(const tilt_series::TiltSeries& series, const align::Alignment& found,
                      double seconds) {
  json views = json::array();
  for (std::size_t v = 0; v < series.views().size(); ++v) {
    // An alignment that was not accepted says nothing against a view.
    const bool is_left_out =
        found.is_accepted && std::ranges::binary_search(found.unaligned, static_cast<int>(v));
    views.push_back(
        view_json(series.views()[v], found.corrections[v], found.joint.agreement[v], is_left_out));
  }
  json record = {{"accepted", found.is_accepted},
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

void add_left_out(const tilt_series::TiltSeries& series, const align::Alignment& first,
                  json& record) {
  for (const int view : first.unaligned) {
    const auto at = static_cast<std::size_t>(view);
    record["views"].push_back(view_json(series.views()[at], {}, first.joint.agreement[at], true));
  }
  std::ranges::stable_sort(record["views"].get_ref<json::array_t&>(), {},
                           [](const json& view) { return view["section"].get<std::int64_t>(); });
}

json read_alignment_record(const std::filesystem::path& path, const json& origin) {
  try {
    json record = io::read_json(path);
    require_origin(record, origin);
    require_sound(record, origin.at("series").at("sections"));
    return record;
  } catch (const std::exception& error) {
    throw Error(
        fmt::format("cannot resume from the alignment '{}': {}; to start over, give --overwrite "
                    "instead of --resume",
                    path.string(), error.what()));
  }
}

void apply_alignment(const json& record, options::ReconstructOptions& options) {
  auto& corrections = options.corrections;
  corrections.assign(record.at("series").at("sections").get<std::size_t>(), {});
  for (const json& view : record.at("views")) {
    const auto section = view.at("section").get<std::int64_t>() - 1;
    corrections[static_cast<std::size_t>(section)] = correction_of(view, record);
    if (view.at("left_out").get<bool>()) options.left_out.push_back(section);
  }
  options.alignment = record;
}

}  // namespace tomofield::realign
