#include "reconstruct/run_pages.h"

#include <optional>

#include "base/trace.h"
#include "exchange/exchange_files.h"
#include "io/saving/atomic_file.h"
#include "report/pictures.h"
#include "report/run_report.h"

namespace tomofield::reconstruction {
namespace {

namespace fs = std::filesystem;

std::optional<fs::path> if_there(const fs::path& file, bool is_expected) {
  return is_expected && fs::exists(file) ? std::optional(file) : std::nullopt;
}

// Writes the report, which embeds files that have temporary names yet.
void write_report(const Run& run, const io::OutputSet& outputs, const RunResult& result,
                  const report::ReportPictures& pictures) {
  io::write_text_file(run.paths.report,
                      report::run_report({.record = result.metrics,
                                          .files = run.options.files,
                                          .options = run.options,
                                          .alignment = run.options.alignment,
                                          .volume = outputs.location_of(run.paths.volume),
                                          .pictures = pictures}));
}

}  // namespace

void write_pages(const Run& run, const io::OutputSet& outputs, RunResult& result) {
  const output::OutputPaths& paths = run.paths;
  const fs::path volume = outputs.location_of(paths.volume);
  report::write_run_pictures(volume, run.series, result.bead_masking, paths);
  result.pictures = paths.pictures();
  exchange::write_exchange_files(run.series, run.options, volume);
  // Trials draw theirs before the fit.
  report::ReportPictures shown{
      .mask = outputs.location_of(paths.mask_picture),
      .tree = {},
      .held_out = {},
      .dial = if_there(paths.dial_picture, run.options.chooses_weight()),
      .prior = if_there(paths.prior_picture, run.options.open_settings().prior)};
  if (run.options.field.tree == TreeKind::kAdaptive) {
    const base::TraceSpan span("draw tree");
    report::write_tree_picture(*result.model, paths.tree_picture);
    shown.tree = outputs.location_of(paths.tree_picture);
  }
  if (run.options.fit.hold_out > 0) shown.held_out = outputs.location_of(paths.held_out_picture);
  write_report(run, outputs, result, shown);
  for (const fs::path& picture : {paths.held_out_picture, paths.choice_picture})
    if (outputs.contains(picture)) result.pictures.push_back(picture);
  for (const auto& picture : {shown.dial, shown.prior})
    if (picture) result.pictures.push_back(*picture);
}

}  // namespace tomofield::reconstruction
