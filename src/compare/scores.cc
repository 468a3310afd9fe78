#include "compare/scores.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <optional>
#include <span>

#include "evaluate/artefacts.h"
#include "evaluate/contrast.h"
#include "evaluate/resolution/fsc.h"
#include "evaluate/similarity.h"
#include "report/pictures.h"

namespace tomofield::compare {
namespace {

using Metrics = std::vector<std::optional<double>>;
using Better = Column::Better;
namespace fs = std::filesystem;

void add_truth_scores(std::span<const Row> rows, const fs::path& truth, Table& table) {
  Metrics psnr, affine_psnr, ssim, affine_ssim;
  for (const Row& row : rows) {
    const evaluate::Comparison scores =
        evaluate::compare(evaluate::read_pair(row.volume, truth, std::nullopt));
    psnr.push_back(scores.psnr.raw_dB);
    affine_psnr.push_back(scores.psnr.affine_dB);
    ssim.push_back(scores.ssim.raw);
    affine_ssim.push_back(scores.ssim.affine);
  }
  table.add({"psnr_dB", "PSNR, dB", Better::kHigher, 2}, psnr);
  table.add({"psnr_affine_dB", "PSNR, scaled", Better::kHigher, 2}, affine_psnr);
  table.add({"ssim", "SSIM", Better::kHigher, 3}, ssim);
  table.add({"ssim_affine", "SSIM, scaled", Better::kHigher, 3}, affine_ssim);
}

std::string boxes_text(const std::vector<base::Box>& boxes) {
  std::vector<std::string> texts;
  for (const base::Box& box : boxes) texts.push_back(evaluate::to_text(box));
  return fmt::format("{}", fmt::join(texts, " and "));
}

// Adds the scores of single volumes: speckle, the face jump of those that have a model, and CNR and
// ENL. Returns a sentence that names the regions of the latter.
std::string add_scores_of_volumes(std::span<const Row> rows, const evaluate::Regions& given,
                                  Table& table) {
  const bool is_given = !given.foreground.empty();
  const Row& reference = rows[reference_row(rows)];
  const evaluate::Regions regions =
      is_given ? given : evaluate::choose_regions(evaluate::read_volume(reference.volume));
  Metrics cnr, enl, speckle_percent, face_jump;
  for (const Row& row : rows) {
    const base::Volume volume = evaluate::read_volume(row.volume);
    const auto score = evaluate::contrast_score(volume, regions);
    cnr.push_back(score.cnr);
    enl.push_back(score.enl);
    const auto found = evaluate::find_artefacts(volume, row.volume, std::nullopt);
    speckle_percent.push_back(found.speckle ? std::optional(100 * *found.speckle) : std::nullopt);
    face_jump.push_back(found.faces ? std::optional(found.faces->both) : std::nullopt);
  }
  table.add({"cnr", "CNR", Better::kHigher, 2}, cnr);
  table.add({"enl", "ENL", Better::kHigher, 1}, enl);
  table.add({"speckle_percent", "speckle, %", Better::kLower, 3}, speckle_percent);
  table.add({"face_jump", "face jump", Better::kNeither, 3}, face_jump);
  return fmt::format(
      "CNR and ENL: foreground {}, background {} (x0,y0,z0,x1,y1,z1 in voxels), {}.",
      boxes_text(regions.foreground), boxes_text(regions.background),
      is_given ? "as given" : "chosen on the volume of " + reference.run.method.title);
}

// Returns the resolution at which the correlation falls to `threshold`. If it never does, returns
// the finest shell's resolution: a method without a value would seem worse than those that have
// one.
std::optional<double> resolution_A(const evaluate::Fsc& fsc, double threshold) {
  const auto crossing = evaluate::crossing_A(fsc.frequency_per_A, fsc.all, threshold);
  const bool falls =
      std::ranges::any_of(fsc.all.correlation, [&](double value) { return value < threshold; });
  return falls ? crossing : std::optional(1 / fsc.frequency_per_A.back());
}

// Correlates pairs of volumes, a pair a method, and adds the resolution at `threshold` as a column.
std::vector<report::Curve> add_correlation(std::span<const Row> rows,
                                           const std::vector<fs::path>& others, double threshold,
                                           Column column, Table& table) {
  Metrics crossings;
  std::vector<report::Curve> curves;
  for (std::size_t i = 0; i < rows.size(); ++i) {
    const evaluate::Fsc fsc = evaluate::correlate_files({rows[i].volume, others[i], {}, {}, {}});
    crossings.push_back(resolution_A(fsc, threshold));
    curves.push_back(
        report::fsc_curve(rows[i].run.method.title, fsc.frequency_per_A, fsc.all.correlation));
  }
  table.add(std::move(column), crossings);
  return curves;
}

void add_held_out_errors(std::span<const Row> rows, Table& table) {
  Metrics errors;
  for (const Row& row : rows) errors.push_back(row.summary.held_out_error);
  table.add({"held_out_error", "held-out error", Better::kLower, 4}, errors);
}

}  // namespace

std::size_t reference_row(std::span<const Row> rows) {
  const auto is_sirt = [](const Row& row) {
    const std::vector<std::string>& words = row.run.method.arguments;
    return words.size() > 1 && words[0] == "baseline" && words[1] == "sirt";
  };
  const auto found = std::ranges::find_if(rows, is_sirt);
  return static_cast<std::size_t>(found == rows.end() ? rows.size() - 1 : found - rows.begin());
}

Scores add_scores(const CompareOptions& options, const std::vector<Purpose>& purposes,
                  const std::vector<Row>& rows, Table& table) {
  const auto rows_for = [&](Purpose purpose) -> std::span<const Row> {
    const auto found = std::ranges::find(purposes, purpose);
    if (found == purposes.end()) return {};
    const std::size_t count = options.methods.size();
    return std::span(rows).subspan(static_cast<std::size_t>(found - purposes.begin()) * count,
                                   count);
  };
  const std::span<const Row> volumes = rows_for(Purpose::kVolume);
  Scores scores;
  if (options.truth) {
    add_truth_scores(volumes, *options.truth, table);
    const std::vector<fs::path> truths(volumes.size(), *options.truth);
    scores.correlations.emplace_back(
        "Shell correlation with the truth",
        add_correlation(volumes, truths, 0.5,
                        {"fsc_truth_0.5_A", "FSC 0.5 with the truth, Å", Better::kLower, 1},
                        table));
  }
  scores.remark = add_scores_of_volumes(volumes, options.regions, table);
  if (options.halves) {
    std::vector<fs::path> even;
    for (const Row& row : rows_for(Purpose::kEvenViews)) even.push_back(row.volume);
    scores.correlations.emplace_back(
        "Shell correlation of odd and even views",
        add_correlation(rows_for(Purpose::kOddViews), even, 0.143,
                        {"fsc_halves_0.143_A", "FSC 0.143 of halves, Å", Better::kLower, 1},
                        table));
  }
  if (!scores.correlations.empty())
    scores.remark += " A shell correlation that never falls so low counts as the finest shell's.";
  if (options.hold_out > 0) add_held_out_errors(rows_for(Purpose::kHeldOutViews), table);
  if (options.hold_out > 0 && options.tune)
    scores.remark +=
        " Held-out errors are of runs that were tuned again, without the views that score them.";
  return scores;
}

}  // namespace tomofield::compare
