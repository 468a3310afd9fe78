#include "verdict/verdict_record.h"

#include "evaluate/evaluation_record.h"

namespace tomofield::verdict {
namespace {

using nlohmann::json;

json held_out_json(const HeldOutSummary& held_out) {
  return {{"median", held_out.median},
          {"worst", held_out.worst},
          {"worst_tilt_deg", held_out.worst_tilt_deg},
          {"of_trials", held_out.is_of_trials}};
}

json axis_json(const AxisCheck& axis) {
  return {{"direction_deg", axis.direction_deg},
          {"best", axis.best},
          {"vertical", axis.vertical},
          {"usual", axis.usual}};
}

json views_json(const ViewAgreement& agreement) {
  json views = json::array();
  for (std::size_t i = 0; i < agreement.views.size(); ++i)
    views.push_back({{"view", agreement.views[i]},
                     {"correlation", agreement.correlation[i]},
                     {"displacement_px", agreement.displacement_px[i]}});
  json order = nullptr;
  if (agreement.tilt_order) order = *agreement.tilt_order;
  return {{"tilt_order", order},
          {"path_correlation", agreement.path.correlation},
          {"path_rise", agreement.path.rise},
          {"residual_correlation", agreement.residual_correlation},
          {"far_correlation", agreement.far_correlation},
          {"axis", agreement.axis ? axis_json(*agreement.axis) : json(nullptr)},
          {"usual_displacement_px", agreement.usual_displacement_px()},
          {"usual_displacement_y_px", agreement.usual_displacement_y_px()},
          {"compared", views}};
}

json rings_json(const RingCheck& check) {
  return {{"factor", check.factor},
          {"agreement", check.agreement},
          {"agreement_as_given", check.given},
          {"standard_error", check.standard_error},
          {"rings", check.rings}};
}

json defocus_json(const DefocusCheck& check) {
  json record{
      {"error", check.error}, {"standard_error", check.standard_error}, {"rings", check.rings}};
  record["spectra"] = check.spectra ? rings_json(*check.spectra) : json(nullptr);
  record["slope"] = nullptr;
  if (check.slope)
    record["slope"] = {{"error", check.slope->error},
                       {"standard_error", check.slope->standard_error}};
  return record;
}

json sections_json(const SectionProfile& sections) {
  return {{"faces", sections.faces}, {"empty_part", sections.empty_part}};
}

json prior_json(const PriorSummary& prior) {
  json record{{"learned", prior.is_used}, {"gain", nullptr}, {"standard_error", nullptr}};
  if (prior.gain)
    record.update(
        {{"gain", prior.gain->log_ratio}, {"standard_error", prior.gain->standard_error}});
  return record;
}

}  // namespace

json verdict_json(const Verdict& verdict) {
  json record = evaluate::artefacts_json(verdict.artefacts.speckle, verdict.artefacts.faces);
  record["line"] = verdict_line(verdict);
  record["residual"] = verdict.residual;
  record["held_out"] = verdict.held_out ? held_out_json(*verdict.held_out) : json(nullptr);
  record["prior"] = prior_json(verdict.prior);
  record["sections"] = sections_json(verdict.sections);
  record["views"] = verdict.views ? views_json(*verdict.views) : json(nullptr);
  record["defocus"] = verdict.defocus ? defocus_json(*verdict.defocus) : json(nullptr);
  record["seconds"] = verdict.seconds;
  record["peak_GiB"] = verdict.peak_GiB;
  record["warnings"] = json::array();
  for (const Warning& warning : verdict.warnings)
    record["warnings"].push_back({{"code", warning.code}, {"message", warning.message}});
  return record;
}

}  // namespace tomofield::verdict
