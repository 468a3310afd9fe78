#include <fmt/format.h>

#include <algorithm>
#include <memory>
#include <optional>
#include <string>
#include <utility>

#include "cli/commands/commands.h"
#include "cli/options/common_options.h"
#include "cli/options/evaluate_options.h"
#include "cli/options/help_formatter.h"
#include "cli/terminal/console.h"
#include "evaluate/artefacts.h"
#include "evaluate/evaluation_record.h"
#include "evaluate/matching/picks.h"
#include "evaluate/reprojection.h"
#include "evaluate/resolution/fsc.h"
#include "evaluate/sheet_filter.h"
#include "evaluate/similarity.h"
#include "io/saving/atomic_file.h"
#include "io/saving/output_set.h"
#include "report/pictures.h"
#include "tilt_series/series_plan.h"

namespace tomofield::cli {
namespace {

// All results, which are written after every score has been computed.
struct Findings {
  evaluate::EvaluationRecord record;
  std::string profile_csv;
};

// Volumes with a correlation below this show the same with opposite signs.
constexpr double kOppositeContrast = -0.3;

void print_comparison(const evaluate::Comparison& comparison) {
  const auto& [psnr, ssim, box] = comparison;
  const base::Shape3 shape = box.shape();
  print("              raw    affine\n");
  print("PSNR (dB) {:8.3f}  {:8.3f}\n", psnr.raw_dB, psnr.affine_dB);
  print("SSIM      {:8.5f}  {:8.5f}\n", ssim.raw, ssim.affine);
  print("correlation {:.5f}, scale {:.5f}, offset {:.5f}, peak {:.5f}\n", psnr.correlation,
        psnr.scale, psnr.offset, psnr.peak);
  if (psnr.correlation < kOppositeContrast)
    print(
        "the volumes have opposite contrast: what is bright in one is dark in the other; --invert "
        "of reconstruct and export turns one of them round\n");
  print("box {} × {} × {} voxels from {},{},{} of the truth\n", shape.nx, shape.ny, shape.nz,
        box.begin[0], box.begin[1], box.begin[2]);
}

// Returns the resolution at which a curve falls below a threshold, or why there is none.
std::string crossing_text(const evaluate::Fsc& fsc, const evaluate::FscCurve& curve,
                          double threshold) {
  if (const auto at = evaluate::crossing_A(fsc.frequency_per_A, curve, threshold))
    return fmt::format("{:.4g} Å", *at);
  return evaluate::starts_below(curve, threshold) ? "at once" : "never";
}

void print_crossings(const char* name, const evaluate::Fsc& fsc, const evaluate::FscCurve& curve) {
  print("{:<14} {:>10} {:>10}\n", name, crossing_text(fsc, curve, 0.5),
        crossing_text(fsc, curve, 0.143));
}

void print_fsc(const evaluate::Fsc& fsc) {
  print("FSC falls below {:>8} {:>10}\n", "0.5", "0.143");
  print_crossings("everywhere", fsc, fsc.all);
  if (fsc.measured) print_crossings("measured", fsc, *fsc.measured);
  if (fsc.missing) print_crossings("missing wedge", fsc, *fsc.missing);
}

void print_contrast(const evaluate::ContrastScore& score, const evaluate::Regions& regions,
                    bool chosen) {
  print("CNR {:.4f}, ENL {:.4f} (normalised to [0, 1] from {:.6g} … {:.6g})\n", score.cnr,
        score.enl, score.low, score.high);
  print("regions {}:", chosen ? "chosen" : "given");
  for (const auto& box : regions.foreground) print(" --foreground {}", evaluate::to_text(box));
  for (const auto& box : regions.background) print(" --background {}", evaluate::to_text(box));
  print("\n");
}

void compare_with_truth(const EvaluateArguments& arguments, Findings& findings) {
  const evaluate::VolumePair pair =
      evaluate::read_pair(arguments.volume, *arguments.truth, arguments.box);
  findings.record.comparison = {evaluate::compare(pair), *arguments.truth};
  print_comparison(findings.record.comparison->scores);
  if (!arguments.profile) return;
  findings.profile_csv = evaluate::profile_csv(
      *arguments.profile, pair.second.voxel_size_A,
      {{"volume", evaluate::line_profile(pair.first, pair.box, *arguments.profile)},
       {"truth", evaluate::line_profile(pair.second, pair.box, *arguments.profile)}});
}

void correlate(const EvaluateArguments& arguments, Findings& findings) {
  const evaluate::FscFiles files{arguments.volume, *arguments.fsc_with, arguments.fsc_mask,
                                 arguments.box, arguments.tilts};
  findings.record.correlation = {evaluate::correlate_files(files), files};
  print_fsc(findings.record.correlation->fsc);
}

void find_membranes(const EvaluateArguments& arguments, Findings& findings) {
  const evaluate::VolumePair pair =
      evaluate::read_pair(arguments.volume, *arguments.membranes, std::nullopt);
  const evaluate::DetectionScore score = evaluate::membrane_score(pair.first, pair.second);
  findings.record.membranes = {score, *arguments.membranes};
  print("membranes: best Dice {:.4f}, average precision {:.4f}\n", score.best_dice,
        score.average_precision);
}

void find_particles(const EvaluateArguments& arguments, Findings& findings) {
  evaluate::require_whole(arguments.volume);
  const base::Volume volume = evaluate::read_volume(arguments.volume);
  std::vector<evaluate::PickScore> scores;
  for (const auto& particle : evaluate::read_particles(*arguments.particles)) {
    scores.push_back(evaluate::pick_score(volume, particle));
    const evaluate::PickScore& score = scores.back();
    print("{:<14} average precision {:.4f} of {} particles, radius {:.0f} Å\n", score.kind,
          score.average_precision, score.num_particles, score.radius_A);
  }
  findings.record.picks = {std::move(scores), *arguments.particles};
}

void reproject(const EvaluateArguments& arguments, Findings& findings) {
  SeriesFiles files = arguments.choices.files;
  files.stack = *arguments.series;
  const Options& chosen = arguments.choices.options;
  const evaluate::VolumeScoreOptions options{
      arguments.volume, tilt_series::series_options(files, chosen), chosen.specimen,
      chosen.field.with_margin, arguments.hold_out};
  const evaluate::VolumeScore score = evaluate::score_volume(options);
  print("reprojection error {:.4f} of the noise's variance in {} views\n", score.errors.total,
        score.errors.views.size());
  for (std::size_t v = 0; v < score.tilt_deg.size(); ++v)
    print("  {:7.2f}°  {:.4f}\n", score.tilt_deg[v], score.errors.view_error[v]);
  findings.record.reprojection = {score, options};
}

void measure_contrast(const EvaluateArguments& arguments, const base::Volume& volume,
                      Findings& findings) {
  const bool chosen = arguments.regions.foreground.empty();
  const evaluate::Regions regions = chosen ? evaluate::choose_regions(volume) : arguments.regions;
  const evaluate::ContrastScore score = evaluate::contrast_score(volume, regions);
  findings.record.contrast = {score, regions, chosen};
  print_contrast(score, regions, chosen);
}

// Returns the ratio along one axis as text.
std::string ratio_text(const std::optional<double>& ratio) {
  return ratio ? fmt::format("{:.4f}", *ratio) : "none";
}

void measure_artefacts(const EvaluateArguments& arguments, const base::Volume& volume,
                       Findings& findings) {
  const evaluate::Artefacts found =
      evaluate::find_artefacts(volume, arguments.volume, arguments.model);
  findings.record.speckle = found.speckle;
  findings.record.faces = found.faces;
  if (found.speckle) print("speckle {:.5f} %\n", 100 * *found.speckle);
  if (found.faces)
    print("face jump {:.4f} (along X {}, along Y {})\n", found.faces->both,
          ratio_text(found.faces->x), ratio_text(found.faces->y));
}

// Computes the scores that need the volume alone.
void examine(const EvaluateArguments& arguments, Findings& findings) {
  const bool has_profile = arguments.profile && !arguments.truth;
  const bool nothing_asked = !arguments.truth && !arguments.fsc_with && !arguments.profile &&
                             !arguments.series && !arguments.membranes && !arguments.particles;
  const bool has_contrast =
      arguments.contrast || !arguments.regions.foreground.empty() || nothing_asked;
  const base::Volume volume = evaluate::read_volume(arguments.volume);
  measure_artefacts(arguments, volume, findings);
  if (has_contrast) measure_contrast(arguments, volume, findings);
  if (!has_profile) return;
  findings.profile_csv = evaluate::profile_csv(
      *arguments.profile, volume.voxel_size_A,
      {{"volume",
        evaluate::line_profile(volume, evaluate::whole_box(volume.shape), *arguments.profile)}});
}

void write_findings(const EvaluateArguments& arguments, const Findings& findings) {
  io::OutputSet results;
  const evaluate::EvaluationRecord& record = findings.record;
  if (arguments.json) evaluate::write_record(*arguments.json, record);
  if (arguments.fsc_csv)
    io::write_text_file(*arguments.fsc_csv, evaluate::fsc_csv(record.correlation->fsc));
  if (arguments.fsc_picture)
    report::write_fsc_picture(record.correlation->fsc, *arguments.fsc_picture);
  if (arguments.profile_csv) io::write_text_file(*arguments.profile_csv, findings.profile_csv);
  results.commit();
}

void run_evaluate(const EvaluateArguments& arguments) {
  const std::vector<io::OutputLock> locks = arguments.claim_outputs();
  Findings findings{.record = {.volume = arguments.volume}, .profile_csv = {}};
  if (arguments.truth) compare_with_truth(arguments, findings);
  if (arguments.fsc_with) correlate(arguments, findings);
  if (arguments.membranes) find_membranes(arguments, findings);
  if (arguments.particles) find_particles(arguments, findings);
  if (arguments.series) reproject(arguments, findings);
  examine(arguments, findings);
  write_findings(arguments, findings);
}

}  // namespace

void add_evaluate_command(CLI::App& program) {
  auto arguments = std::make_shared<EvaluateArguments>();
  CLI::App* command = program.add_subcommand(
      "evaluate",
      "Score a volume against a truth, another half or the views of a tilt series, or by its "
      "contrast and noise");
  add_evaluate_options(*command, *arguments);
  add_common_options(*command);
  add_help_all(*command);
  command->callback([arguments] { run_stoppable([&] { run_evaluate(*arguments); }); });
}

}  // namespace tomofield::cli
