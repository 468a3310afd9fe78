#include "verdict/verdict.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cstddef>
#include <numeric>

#include "base/log.h"
#include "base/statistics.h"
#include "evaluate/artefacts.h"

namespace tomofield::verdict {
namespace {

nlohmann::json held_out_json(const HeldOutSummary& held_out) {
  return {{"median", held_out.median},
          {"worst", held_out.worst},
          {"worst_tilt_deg", held_out.worst_tilt_deg},
          {"of_trials", held_out.is_of_trials}};
}

nlohmann::json axis_json(const AxisCheck& axis) {
  return {{"direction_deg", axis.direction_deg},
          {"best", axis.best},
          {"vertical", axis.vertical},
          {"usual", axis.usual}};
}

nlohmann::json views_json(const ViewAgreement& agreement) {
  nlohmann::json views = nlohmann::json::array();
  for (std::size_t i = 0; i < agreement.views.size(); ++i)
    views.push_back({{"view", agreement.views[i]},
                     {"correlation", agreement.correlation[i]},
                     {"displacement_px", agreement.displacement_px[i]}});
  nlohmann::json order = nullptr;
  if (agreement.tilt_order) order = *agreement.tilt_order;
  return {{"tilt_order", order},
          {"path_correlation", agreement.path.correlation},
          {"path_rise", agreement.path.rise},
          {"residual_correlation", agreement.residual_correlation},
          {"far_correlation", agreement.far_correlation},
          {"axis", agreement.axis ? axis_json(*agreement.axis) : nlohmann::json(nullptr)},
          {"usual_displacement_px", agreement.usual_displacement_px()},
          {"usual_displacement_y_px", agreement.usual_displacement_y_px()},
          {"compared", views}};
}

nlohmann::json rings_json(const RingCheck& check) {
  return {{"factor", check.factor},
          {"agreement", check.agreement},
          {"agreement_as_given", check.given},
          {"standard_error", check.standard_error},
          {"rings", check.rings}};
}

nlohmann::json defocus_json(const DefocusCheck& check) {
  nlohmann::json json{
      {"error", check.error}, {"standard_error", check.standard_error}, {"rings", check.rings}};
  json["spectra"] = check.spectra ? rings_json(*check.spectra) : nlohmann::json(nullptr);
  json["slope"] = nullptr;
  if (check.slope)
    json["slope"] = {{"error", check.slope->error},
                     {"standard_error", check.slope->standard_error}};
  return json;
}

nlohmann::json sections_json(const SectionProfile& sections) {
  return {{"faces", sections.faces}, {"empty_part", sections.empty_part}};
}

nlohmann::json prior_json(const PriorSummary& prior) {
  nlohmann::json json{{"learned", prior.is_used}, {"gain", nullptr}, {"standard_error", nullptr}};
  if (prior.gain)
    json.update({{"gain", prior.gain->log_ratio}, {"standard_error", prior.gain->standard_error}});
  return json;
}

std::string prior_text(const PriorSummary& prior) {
  if (!prior.gain) return "learned prior";
  return fmt::format(
      "{}learned prior, which changes the held-out error by {:+.2f} % ± {:.2f} in trials",
      prior.is_used ? "" : "no ", -100 * prior.gain->log_ratio, 100 * prior.gain->standard_error);
}

std::string held_out_text(const HeldOutSummary& held_out) {
  return fmt::format("held out{}: median {:.2f}, worst {:.2f} (at {:.1f}°)",
                     held_out.is_of_trials ? " in trials" : "", held_out.median, held_out.worst,
                     held_out.worst_tilt_deg);
}

}  // namespace

SectionProfile section_profile(const std::vector<double>& deviation) {
  if (deviation.empty()) return {};
  const std::vector<float> values(deviation.begin(), deviation.end());
  const std::ptrdiff_t count = std::ssize(values), outer = std::max<std::ptrdiff_t>(count / 20, 1);
  const double top = std::accumulate(deviation.begin(), deviation.begin() + outer, 0.0);
  const double bottom = std::accumulate(deviation.end() - outer, deviation.end(), 0.0);
  const double middle = base::median({values.begin() + count / 4, values.end() - count / 4});
  const double limit = 0.3 * base::percentile(values, 80);
  const auto empty = std::ranges::count_if(deviation, [&](double d) { return d < limit; });
  SectionProfile profile;
  if (middle > 0.0) profile.faces = std::min(top, bottom) / static_cast<double>(outer) / middle;
  profile.empty_part = static_cast<double>(empty) / static_cast<double>(count);
  return profile;
}

nlohmann::json verdict_json(const Verdict& verdict) {
  nlohmann::json json =
      evaluate::artefacts_json(verdict.artefacts.speckle, verdict.artefacts.faces);
  json["line"] = verdict_line(verdict);
  json["residual"] = verdict.residual;
  json["held_out"] = verdict.held_out ? held_out_json(*verdict.held_out) : nlohmann::json(nullptr);
  json["prior"] = prior_json(verdict.prior);
  json["sections"] = sections_json(verdict.sections);
  json["views"] = verdict.views ? views_json(*verdict.views) : nlohmann::json(nullptr);
  json["defocus"] = verdict.defocus ? defocus_json(*verdict.defocus) : nlohmann::json(nullptr);
  json["seconds"] = verdict.seconds;
  json["peak_GiB"] = verdict.peak_GiB;
  json["warnings"] = nlohmann::json::array();
  for (const Warning& warning : verdict.warnings)
    json["warnings"].push_back({{"code", warning.code}, {"message", warning.message}});
  return json;
}

std::string verdict_line(const Verdict& verdict) {
  std::vector<std::string> parts{
      fmt::format("residual {:.2f} of the noise's variance", verdict.residual)};
  if (verdict.views) {
    const auto [x, y] = verdict.views->residual_correlation;
    parts.push_back(fmt::format("correlation of neighbours {:.2f}, {:.2f}", x, y));
  }
  if (verdict.held_out) parts.push_back(held_out_text(*verdict.held_out));
  if (verdict.prior.is_used || verdict.prior.gain) parts.push_back(prior_text(verdict.prior));
  if (verdict.artefacts.speckle)
    parts.push_back(fmt::format("speckle {:.3f} %", 100 * *verdict.artefacts.speckle));
  if (verdict.artefacts.faces)
    parts.push_back(fmt::format("faces {:.2f}", verdict.artefacts.faces->both));
  parts.push_back(fmt::format("{:.1f} s, {:.2f} GiB", verdict.seconds, verdict.peak_GiB));
  return fmt::format("verdict: {}", fmt::join(parts, "; "));
}

void log_verdict(const Verdict& verdict) {
  base::log_info(verdict_line(verdict));
  for (const Warning& warning : verdict.warnings) base::log_warning(warning.message);
}

}  // namespace tomofield::verdict
