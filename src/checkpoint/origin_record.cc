#include "checkpoint/origin_record.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <map>
#include <set>

#include "io/json.h"
#include "option_table/rows.h"
#include "options/options_record.h"
#include "tomofield/error.h"
#include "tune/trial_record.h"

namespace tomofield::checkpoint {
namespace {

using nlohmann::json;

// Writes the x-axis tilt, the 2 × 2 matrix and the shift of each view.
json alignment_json(const geometry::RayGeometry& g) {
  json views = json::array();
  for (std::size_t v = 0; v < g.x_tilt_deg.size(); ++v) {
    const geometry::RawFromAligned& m = g.raw_from_aligned[v];
    views.push_back({g.x_tilt_deg[v], m.m11, m.m12, m.m21, m.m22, m.shift_x_px, m.shift_y_px});
  }
  return views;
}

json transfers_json(const std::vector<microscope::ViewTransfer>& transfers) {
  json all = json::array();
  for (const microscope::ViewTransfer& t : transfers)
    all.push_back({t.optics.voltage_kV, t.optics.spherical_aberration_mm,
                   t.optics.amplitude_contrast, t.optics.b_factor_A2, t.defocus.u_A, t.defocus.v_A,
                   t.defocus.angle_deg, t.defocus.phase_shift_deg, t.slope.at_centre_A, t.slope.x_A,
                   t.slope.y_A, t.exposure, t.pixel_size_A, t.is_flipped});
  if (!transfers.empty() && transfers.front().detector)  // that of all views
    all.push_back(
        {transfers.front().detector->mtf.frequencies, transfers.front().detector->mtf.values});
  return all;
}

// Returns the name that a user has for an entry of a fingerprint: a flag, or a part of the input.
std::string name_of(const std::string& key) {
  // These entries are no options themselves; an option decides each.
  static const std::map<std::string, std::string> derived{{"field.depth", "field.leaf_size"},
                                                          {"bin_factor", "input.bin"}};
  const auto other = derived.find(key);
  const auto flag = option_table::flag_of(other == derived.end() ? key : other->second);
  if (!flag.empty()) return std::string(flag);
  if (key.starts_with("alignment")) return "the alignment of the views";
  for (const char* of_series : {"rays", "noise_sigma", "unit", "tilt_deg"})
    if (key.starts_with(of_series)) return "the tilt series or how it is read";
  return key;
}

}  // namespace

std::string fingerprint_of(const options::ReconstructOptions& options,
                           const measurement::Measurement& series,
                           const distributed::Communicator& processes) {
  json all = options::options_json(options);
  all.erase("input");
  all.erase("volume");
  for (const char* of_results : {"budget", "tile_rows"})  // they change no stage of the fit
    all["field"].erase(of_results);
  all["fit"].erase("split_tilts");  // the views of a half tell it apart
  all["fit"]["denoise"] = options::denoise_factor(options.fit.denoise);  // "strong" and "2" are one
  all["tilt_deg"] = series.geometry.tilt_deg;
  if (series.ray_geometry) all["alignment"] = alignment_json(*series.ray_geometry);
  all["bin_factor"] = series.bin_factor;
  all["unit"] = series.unit;
  all["noise_sigma"] = series.noise_sigma;
  if (!series.left_out.empty()) all["left_out"] = series.left_out;
  if (!series.transfers.empty()) all["transfers"] = transfers_json(series.transfers);
  all["rays"] = fmt::format("{:016x}", series.rays->checksum(processes));
  return all.dump();
}

std::string different_options(const std::string& found, const std::string& wanted) {
  const auto parse = [](const std::string& text) {
    try {
      return io::parse_json(text);
    } catch (const Error&) {
      return json();
    }
  };
  std::set<std::string> names;
  for (const json& change : json::diff(parse(found), parse(wanted))) {
    std::string name = change["path"].get<std::string>();
    const std::size_t index = name.find_first_of("0123456789");
    if (index != std::string::npos) name.resize(index);  // the name of an array is enough
    std::ranges::replace(name, '/', '.');
    const std::size_t first = name.find_first_not_of('.');
    if (first == std::string::npos) return "everything";
    names.insert(name_of(name.substr(first, name.find_last_not_of('.') + 1 - first)));
  }
  return fmt::format("{}", fmt::join(names, ", "));
}

std::string trials_text(const tune::TunedFit& tuned) {
  json text = tune::tuning_json(tuned);
  for (const char* key : {"trials", "last_trials"})
    for (json& trial : text[key]) trial.erase("seconds");
  return text.dump();
}

tune::TunedFit trials_from(const std::string& text) {
  try {
    return tune::tuned_from(io::parse_json(text));
  } catch (const json::exception& error) {
    throw Error(io::fault_text(error));
  }
}

}  // namespace tomofield::checkpoint
