#include <fmt/format.h>

#include <array>
#include <cmath>
#include <filesystem>
#include <limits>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "cli/commands/commands.h"
#include "cli/options/common_options.h"
#include "cli/options/help_formatter.h"
#include "cli/options/number_checks.h"
#include "cli/options/table_options.h"
#include "cli/terminal/console.h"
#include "compact/budget.h"
#include "compact/compress.h"
#include "io/saving/output_files.h"
#include "io/saving/output_lock.h"
#include "io/saving/output_set.h"
#include "output/model_file.h"
#include "output/volume.h"
#include "tomofield/error.h"

namespace tomofield::cli {
namespace {

using field::OrientedBox;
using output::Model;

struct ExportArguments {
  std::filesystem::path model;
  std::filesystem::path output;
  std::filesystem::path compact;  // model to write in place of a volume
  std::string budget = "0.1dB";   // of that model
  std::vector<double> box, centre, rotation;
  std::vector<std::int64_t> size;
  std::optional<double> voxel_size_A;
  double bin = 1.0;
  option_table::Choices choices;  // of the volume group alone
  bool overwrite = false;
};

// Checks that the file can be written, and locks it.
std::vector<io::OutputLock> claim_output(const ExportArguments& arguments) {
  const std::filesystem::path& written =
      arguments.compact.empty() ? arguments.output : arguments.compact;
  return io::claim_outputs({written}, [&] {
    constexpr const char* kAdvice = "give another name, or --overwrite to replace it";
    io::check_output_files({written}, {arguments.model}, arguments.overwrite, kAdvice);
    if (arguments.compact.empty()) io::require_volume_name(arguments.output);
    if (arguments.compact.empty() && arguments.choices.options.volume.zarr)
      output::check_zarr(arguments.output, arguments.overwrite, kAdvice);
  });
}

field::Point point(const double* numbers) { return {numbers[0], numbers[1], numbers[2]}; }

OrientedBox unrotated_box(const ExportArguments& arguments, const Model& model) {
  const double voxel_px =
      arguments.voxel_size_A ? *arguments.voxel_size_A / model.pixel_size_A : arguments.bin;
  if (!arguments.size.empty())
    return {.centre_px = point(arguments.centre.data()),
            .size = {arguments.size[0], arguments.size[1], arguments.size[2]},
            .voxel_px = voxel_px};
  if (arguments.box.empty()) return output::region_box(model, voxel_px);
  const field::Point low = point(arguments.box.data()), high = point(arguments.box.data() + 3);
  for (std::size_t a = 0; a < 3; ++a) {
    const double voxels = (high[a] - low[a]) / voxel_px;
    if (voxels > 0 && voxels <= std::numeric_limits<std::int32_t>::max()) continue;
    throw Error(fmt::format(
        "--box has {} from {} to {}, {:.6g} voxels: give x0,y0,z0,x1,y1,z1 with the low corner "
        "first",
        "xyz"[a], low[a], high[a], voxels));
  }
  return field::box_between(low, high, voxel_px);
}

// Writes the model again with factors in place of its vertices.
void write_compact(const ExportArguments& arguments) {
  const compact::Budget budget = compact::parse_budget(arguments.budget);
  Model model = output::load_undecoded(arguments.model);
  if (model.coded)
    throw Error(fmt::format("'{}' is compact already: make another one from the model of the fit",
                            arguments.model.string()));
  if (model.field->kind() != FieldKind::kGrid) {
    throw Error(fmt::format(
        "'{}' is a model of factors, and --compact is for models of vertices (--field grid)",
        arguments.model.string()));
  }
  compact::CompactField made = compact::compress(
      *model.field, model.roi, budget,
      [&](const compact::CodedField& coded) { return output::coded_file_size(coded, model); });
  model.field = std::move(made.field);
  model.coded = std::move(made.coded);
  io::OutputSet results;
  output::save_model(arguments.compact, model);
  results.commit();
  print(
      "{}: {} parameters in {} leaves, {} bytes; the densities change by {:.4g} times their "
      "standard deviation\n",
      arguments.compact.string(), made.report.parameters, model.field->tree().num_leaves(),
      std::filesystem::file_size(arguments.compact),
      std::sqrt(made.report.mean_square_change / made.report.variance));
}

void run_export(ExportArguments& arguments) {
  if (arguments.output.empty() && arguments.compact.empty())
    throw Error("nothing to write: give -o VOLUME.mrc, or --compact MODEL.h5");
  const std::vector<io::OutputLock> locks = claim_output(arguments);
  if (!arguments.compact.empty()) return write_compact(arguments);
  const Model model = output::load_undecoded(arguments.model);
  OrientedBox box = unrotated_box(arguments, model);
  const auto& angles = arguments.rotation;
  if (!angles.empty())
    box.field_from_box = field::rotation_from_euler(angles[0], angles[1], angles[2]);
  io::OutputSet results;
  output::write_volume(model, arguments.choices.options.volume, arguments.output, {.box = box});
  results.commit();
  print("{}: {} × {} × {} voxels (x, y, z) of {:.6g} Å about {:.6g}, {:.6g}, {:.6g} px\n",
        arguments.output.string(), box.size[0], box.size[1], box.size[2],
        box.voxel_px * model.pixel_size_A, box.centre_px[0], box.centre_px[1], box.centre_px[2]);
}

void add_box_options(CLI::App& command, ExportArguments& arguments) {
  const char* group = "Box (pixels of the model: the binned view at zero tilt, z from 0 up)";
  const CLI::Validator finite(
      [](std::string& text) {
        return std::isfinite(std::strtod(text.c_str(), nullptr)) ? "" : text + " is not finite";
      },
      "", "finite");
  CLI::Option* box =
      command
          .add_option(
              "--box", arguments.box,
              "Corners of the box (default: the region of interest and the whole thickness)")
          ->delimiter(',')
          ->expected(6)
          ->type_name("X0,Y0,Z0,X1,Y1,Z1")
          ->check(finite)
          ->group(group);
  CLI::Option* centre = command.add_option("--center", arguments.centre, "Centre of the box")
                            ->delimiter(',')
                            ->expected(3)
                            ->type_name("X,Y,Z")
                            ->check(finite)
                            ->excludes(box)
                            ->group(group);
  CLI::Option* size = command.add_option("--size", arguments.size, "Size of the box in voxels")
                          ->delimiter(',')
                          ->expected(3)
                          ->type_name("NX,NY,NZ")
                          ->check(number_between(1, std::numeric_limits<std::int32_t>::max()))
                          ->needs(centre)
                          ->group(group);
  centre->needs(size);
  command
      .add_option("--rotate", arguments.rotation,
                  "RELION's Euler angles in degrees (rlnAngleRot, rlnAngleTilt, rlnAnglePsi). The "
                  "box turns about its centre, so that a particle appears in the orientation of "
                  "its reference")
      ->delimiter(',')
      ->expected(3)
      ->type_name("ROT,TILT,PSI")
      ->check(finite)
      ->group(group);
  const CLI::Validator positive = number_between(1e-3, 1e6);
  CLI::Option* voxel_size = command
                                .add_option("--voxel-size", arguments.voxel_size_A,
                                            "Voxel size in Å (default: the pixel size)")
                                ->check(positive)
                                ->group(group);
  command.add_option("--bin", arguments.bin, "Voxel size in pixels")
      ->check(positive)
      ->excludes(voxel_size)
      ->group(group);
}

}  // namespace

void add_export_command(CLI::App& program) {
  auto arguments = std::make_shared<ExportArguments>();
  CLI::App* command = program.add_subcommand(
      "export",
      "Write any box of a model, at any voxel size and orientation, as an MRC volume; or make a "
      "model compact");
  command->add_option("model", arguments->model, "Model file (.h5) of reconstruct")->required();
  CLI::Option* volume =
      command->add_option("-o,--output", arguments->output, "The MRC volume to write");
  CLI::Option* compact = command
                             ->add_option("--compact", arguments->compact,
                                          "The compact model (.h5) to write in place of a volume")
                             ->excludes(volume);
  command
      ->add_option("--budget", arguments->budget,
                   "How close or how small the compact model is: decibels (0.1dB), parameters "
                   "(500k, 2M) or bytes (800kB, 5MB)")
      ->type_name("AMOUNT")
      ->default_str(arguments->budget)
      ->needs(compact);
  command->add_flag("--overwrite", arguments->overwrite, "Replace an existing file");
  add_box_options(*command, *arguments);
  add_groups(*command, arguments->choices, {option_table::Group::kVolume});
  add_common_options(*command);
  add_help_all(*command);
  command->callback([arguments] { run_export(*arguments); });
}

}  // namespace tomofield::cli
