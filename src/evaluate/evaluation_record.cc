#include "evaluate/evaluation_record.h"

#include <cmath>

#include "base/utf8.h"
#include "io/json.h"

namespace tomofield::evaluate {
namespace {

using nlohmann::json;

json number_json(const std::optional<double>& number) { return number ? json(*number) : json(); }

json curve_json(const Fsc& fsc, const FscCurve& curve) {
  return {
      {"resolution_at_0.5_A", number_json(crossing_A(fsc.frequency_per_A, curve, 0.5))},
      {"resolution_at_0.143_A", number_json(crossing_A(fsc.frequency_per_A, curve, 0.143))},
      {"correlation_at_100_A", number_json(correlation_at(fsc.frequency_per_A, curve, kCoarse_A))},
      {"correlation_at_30_A", number_json(correlation_at(fsc.frequency_per_A, curve, kFine_A))},
      {"correlation", curve.correlation},
      {"voxels", curve.voxels}};
}

json comparison_json(const EvaluationRecord::WithTruth& truth) {
  const Comparison& comparison = truth.scores;
  return {{"truth", base::utf8_text(truth.truth.string())},
          {"psnr_raw_dB", comparison.psnr.raw_dB},
          {"psnr_affine_dB", comparison.psnr.affine_dB},
          {"ssim_raw", comparison.ssim.raw},
          {"ssim_affine", comparison.ssim.affine},
          {"correlation", comparison.psnr.correlation},
          {"scale", comparison.psnr.scale},
          {"offset", comparison.psnr.offset},
          {"peak", comparison.psnr.peak},
          {"box_first", comparison.box.begin},
          {"box_last", comparison.box.end}};
}

json membrane_json(const EvaluationRecord::WithLabel& membranes) {
  const auto& [score, label] = membranes;
  return {{"label", base::utf8_text(label.string())},
          {"best_dice", score.best_dice},
          {"average_precision", score.average_precision}};
}

json picks_json(const EvaluationRecord::WithParticles& picks) {
  json record{{"particles", base::utf8_text(picks.list.string())}};
  for (const PickScore& score : picks.scores)
    record["kinds"][score.kind] = {{"particles", score.num_particles},
                                   {"radius_A", score.radius_A},
                                   {"average_precision", score.average_precision}};
  return record;
}

json reprojection_json(const EvaluationRecord::WithViews& reprojection) {
  const auto& [score, options] = reprojection;
  json views = json::array();
  for (std::size_t v = 0; v < score.errors.views.size(); ++v) {
    views.push_back({{"view", score.errors.views[v]},
                     {"tilt_deg", score.tilt_deg[v]},
                     {"error", score.errors.view_error[v]},
                     {"noise_sigma", score.unit / std::sqrt(score.errors.models[v].weight)},
                     {"scale", score.errors.models[v].scale * score.unit},
                     {"offset", score.errors.models[v].offset * score.unit}});
  }
  return {{"series", base::utf8_text(options.input.stack.string())},
          {"hold_out", options.hold_out},
          {"error", score.errors.total},
          {"views", views}};
}

json contrast_json(const EvaluationRecord::OfRegions& contrast) {
  const auto& [score, regions, are_chosen] = contrast;
  const auto boxes = [](const std::vector<base::Box>& all) {
    json list = json::array();
    for (const base::Box& box : all) list.push_back(to_text(box));
    return list;
  };
  return {{"cnr", score.cnr},
          {"enl", score.enl},
          {"foreground", boxes(regions.foreground)},
          {"background", boxes(regions.background)},
          {"foreground_mean", score.foreground_mean},
          {"foreground_deviation", score.foreground_deviation},
          {"background_mean", score.background_mean},
          {"background_deviation", score.background_deviation},
          {"normalised_from", {score.low, score.high}},
          {"regions_chosen", are_chosen}};
}

}  // namespace

json fsc_json(const Fsc& fsc, const FscFiles& files) {
  json record = {{"first", base::utf8_text(files.first.string())},
                 {"second", base::utf8_text(files.second.string())},
                 {"frequency_per_A", fsc.frequency_per_A},
                 {"all", curve_json(fsc, fsc.all)}};
  record["mask"] = files.mask ? json(base::utf8_text(files.mask->string())) : json();
  if (files.box) {
    record["box_first"] = files.box->begin;
    record["box_last"] = files.box->end;
  }
  if (files.tilts) {
    record["tilt_range_deg"] = {files.tilts->low_deg, files.tilts->high_deg};
    record["measured"] = curve_json(fsc, *fsc.measured);
    record["missing"] = curve_json(fsc, *fsc.missing);
  }
  return record;
}

json artefacts_json(const std::optional<double>& speckle, const std::optional<FaceJump>& faces) {
  const auto value = [](const std::optional<double>& number) {
    return number ? json(*number) : json(nullptr);
  };
  json jump = nullptr;
  if (faces) jump = {{"both", faces->both}, {"x", value(faces->x)}, {"y", value(faces->y)}};
  return {{"speckle", value(speckle)}, {"face_jump", jump}};
}

void write_record(const std::filesystem::path& file, const EvaluationRecord& record) {
  json metrics{{"reconstruction", base::utf8_text(record.volume.string())}};
  if (record.comparison) metrics.update(comparison_json(*record.comparison));
  if (record.correlation)
    metrics["fsc"] = fsc_json(record.correlation->fsc, record.correlation->files);
  if (record.membranes) metrics["membranes"] = membrane_json(*record.membranes);
  if (record.picks) metrics["picks"] = picks_json(*record.picks);
  if (record.reprojection) metrics["reprojection"] = reprojection_json(*record.reprojection);
  if (record.contrast) metrics["contrast"] = contrast_json(*record.contrast);
  metrics.update(artefacts_json(record.speckle, record.faces));
  io::write_json(file, metrics);
}

}  // namespace tomofield::evaluate
