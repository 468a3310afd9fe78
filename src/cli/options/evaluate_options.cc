#include "cli/options/evaluate_options.h"

#include <fmt/core.h>

#include <algorithm>
#include <string>
#include <vector>

#include "base/check.h"
#include "cli/options/number_checks.h"
#include "cli/options/place_options.h"
#include "cli/options/table_options.h"
#include "evaluate/matching/picks.h"
#include "io/saving/output_files.h"
#include "output/output_paths.h"
#include "tomofield/error.h"

namespace tomofield::cli {
namespace {

void add_comparison_options(CLI::App& command, EvaluateArguments& arguments) {
  command.add_option("volume", arguments.volume, "MRC volume to score")
      ->type_name("VOLUME")
      ->required();
  command
      .add_option(
          "truth", arguments.truth,
          "MRC volume of the truth: computes PSNR and SSIM, raw and after the best scale and "
          "offset")
      ->type_name("TRUTH");
  command
      .add_option_function<std::string>(
          "--box", [&arguments](const std::string& text) { arguments.box = parse_box(text); },
          "Compare only these voxels of the other volume (PSNR, SSIM, FSC). Voxels count from 0; "
          "X1, "
          "Y1 and Z1 lie outside")
      ->check(box_check())
      ->type_name(kBoxType);
}

void add_fsc_options(CLI::App& command, EvaluateArguments& arguments) {
  const char* group = "Fourier shell correlation";
  const auto add_file = [&](const char* name, std::optional<std::filesystem::path>& file,
                            const char* help) {
    return command.add_option(name, file, help)->type_name("FILE")->group(group);
  };
  CLI::Option* fsc = add_file("--fsc", arguments.fsc_with,
                              "Correlate with this MRC volume: the other half, or the truth");
  add_file("--fsc-mask", arguments.fsc_mask,
           "MRC volume with weights from 0 to 1, soft at its edges; default: a weight of 1 that "
           "fades over the outer eighth at every face")
      ->needs(fsc);
  command
      .add_option_function<std::vector<double>>(
          "--tilt-range",
          [&arguments](const std::vector<double>& tilts) {
            arguments.tilts = {tilts[0], tilts[1]};
          },
          "Lowest and highest tilt in degrees, such as --tilt-range=-60,50. Correlates the "
          "measured "
          "frequencies and the missing wedge separately; the tilt axis is Y")
      ->delimiter(',')
      ->expected(2)
      ->check(number_between(-90.0, 90.0))
      ->type_name("LOW,HIGH")
      ->needs(fsc)
      ->group(group);
  add_file("--fsc-csv", arguments.fsc_csv, "Write the curves as a table")->needs(fsc);
  add_file("--fsc-picture", arguments.fsc_picture, "Draw the curves (PNG)")->needs(fsc);
}

void add_finding_options(CLI::App& command, EvaluateArguments& arguments) {
  const char* group = "Membranes and particles";
  command
      .add_option("--membranes", arguments.membranes,
                  "MRC volume that is 1 in membranes and 0 elsewhere: find sheets in VOLUME, in "
                  "which high is dense, and compare them voxel by voxel")
      ->type_name("LABEL")
      ->group(group);
  command
      .add_option("--particles", arguments.particles,
                  "particles.star of simulate, with particle_KIND.mrc beside it: find particles of "
                  "each kind in VOLUME by correlation, and compare them with the list")
      ->type_name("LIST")
      ->group(group);
}

void add_contrast_options(CLI::App& command, EvaluateArguments& arguments) {
  const char* group = "Contrast and noise";
  command
      .add_flag(
          "--cnr", arguments.contrast,
          "Compute the contrast-to-noise ratio and the equivalent number of looks; the "
          "program chooses the regions unless --foreground and --background give them (default if "
          "no other score is asked for)")
      ->group(group);
  add_region_options(command, "VOLUME", group, arguments.regions);
}

void add_artefact_options(CLI::App& command, EvaluateArguments& arguments) {
  command
      .add_option("--model", arguments.model,
                  "Model of VOLUME, whose leaves tell where the face jump is measured (default: "
                  "VOLUME's name with .h5, if that is there)")
      ->type_name("MODEL.h5")
      ->group("Speckle and faces");
}

void add_profile_options(CLI::App& command, EvaluateArguments& arguments) {
  const char* group = "Line profile";
  CLI::Option* line = add_profile_option(
      command,
      "Sample a line between two points, in voxels (of TRUTH, if there is one); voxel i covers [i, "
      "i+1)",
      group, arguments.profile);
  CLI::Option* csv =
      command.add_option("--profile-csv", arguments.profile_csv, "Write the profile to this table")
          ->type_name("FILE")
          ->group(group);
  line->needs(csv);
  csv->needs(line);
}

// Adds the options of the series and of the volume's place in it. They need --series.
void add_reprojection_options(CLI::App& command, EvaluateArguments& arguments) {
  const char* group = "Reprojection error";
  CLI::Option* series =
      command
          .add_option(
              "--series", arguments.series,
              "Tilt series (MRC stack): project the volume and compare it with the views, after "
              "the best scale and offset of each view. Takes the same options for the "
              "series as reconstruct")
          ->type_name("STACK")
          ->group(group);
  const std::size_t first = command.get_options().size();
  command
      .add_option("--hold-out", arguments.hold_out,
                  "Score only the views that reconstruct --hold-out N keeps from the fit")
      ->check(number_above(0))
      ->type_name("N")
      ->group(group);
  add_series_options(command, arguments.choices);
  add_place_options(command, arguments.choices);
  const std::vector<CLI::Option*> options = command.get_options();
  for (std::size_t i = first; i < options.size(); ++i) options[i]->needs(series);
}

}  // namespace

std::vector<io::OutputLock> EvaluateArguments::claim_outputs() const {
  if (box && !truth && !fsc_with)
    throw Error("--box restricts a comparison: name a truth to compare with, or give --fsc");
  if (tilts && !(tilts->low_deg < tilts->high_deg))
    throw Error(
        fmt::format("--tilt-range must be from a lower to a higher tilt, not from {:g}° to "
                    "{:g}°",
                    tilts->low_deg, tilts->high_deg));
  Options series_options = choices.options;
  series_options.specimen.thickness = 1;  // the volume has its own
  base::require_no_faults(option_table::range_faults(series_options));
  SeriesFiles files = choices.files;
  if (series) files.stack = *series;
  std::vector<std::filesystem::path> inputs = io::input_files(files), outputs;
  inputs.push_back(volume);
  if (!model) inputs.push_back(output::output_paths(volume).model);
  for (const auto& file : {truth, fsc_with, fsc_mask, membranes, particles, model})
    if (file) inputs.push_back(*file);
  if (particles)
    for (const std::string& kind : evaluate::particle_kinds(*particles))
      inputs.push_back(evaluate::density_of(*particles, kind));
  for (const auto& file : {json, fsc_csv, fsc_picture, profile_csv})
    if (file) outputs.push_back(*file);
  return io::claim_outputs(outputs, [&] {
    io::check_output_files(outputs, inputs, overwrite,
                           "give another name, or --overwrite to replace it");
  });
}

void add_evaluate_options(CLI::App& command, EvaluateArguments& arguments) {
  add_comparison_options(command, arguments);
  add_fsc_options(command, arguments);
  add_finding_options(command, arguments);
  add_contrast_options(command, arguments);
  add_artefact_options(command, arguments);
  add_profile_options(command, arguments);
  add_reprojection_options(command, arguments);
  command.add_option("--json", arguments.json, "Write all metrics to this JSON file")
      ->type_name("FILE");
  command.add_flag("--overwrite", arguments.overwrite, "Replace existing files");
}

}  // namespace tomofield::cli
