#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <filesystem>
#include <limits>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "base/check.h"
#include "base/near_whole.h"
#include "cli/commands/commands.h"
#include "cli/options/common_options.h"
#include "cli/options/help_formatter.h"
#include "cli/options/number_checks.h"
#include "cli/options/table_options.h"
#include "cli/terminal/console.h"
#include "compact/budget.h"
#include "compact/compress.h"
#include "exchange/model_export.h"
#include "exchange/particles/particle_stack.h"
#include "io/saving/output_files.h"
#include "io/saving/output_lock.h"
#include "io/saving/output_set.h"
#include "output/model_file.h"
#include "output/volume.h"
#include "output/volume_frame.h"
#include "tomofield/error.h"
#include "tomofield/model.h"

namespace tomofield::cli {
namespace {

using field::OrientedBox;
using output::Model;

struct ExportArguments {
  std::filesystem::path model;
  std::filesystem::path output;
  std::filesystem::path compact;    // model to write in place of a volume
  std::string budget = "0.1dB";     // of that model
  std::filesystem::path particles;  // list of places to cut out
  std::string tomogram;             // whose particles these are
  std::string box;                  // corners, or the side of the boxes of particles in voxels
  std::string level;                // kFound, or two angles
  std::vector<double> centre, rotation;
  std::vector<std::int64_t> size;
  std::optional<double> voxel_size_A;
  double bin = 1.0;
  option_table::Choices choices;  // of the volume group alone
  bool overwrite = false;
};

constexpr const char* kFound = "found";

exchange::ExportFiles files_of(const ExportArguments& arguments) {
  return {.output = arguments.output,
          .model = arguments.model,
          .particles = arguments.particles,
          .volume = arguments.choices.options.volume,
          .overwrite = arguments.overwrite};
}

// Checks that the files can be written, and locks the first one.
std::vector<io::OutputLock> claim_output(const ExportArguments& arguments) {
  constexpr const char* kAdvice = "give another name, or --overwrite to replace it";
  if (arguments.compact.empty()) return exchange::claim_export(files_of(arguments), kAdvice);
  return io::claim_outputs({arguments.compact}, [&] {
    base::require_no_faults(output::faults_of(arguments.choices.options.volume));
    io::check_output_files({arguments.compact}, {arguments.model}, arguments.overwrite, kAdvice);
  });
}

field::Point point(const double* numbers) { return {numbers[0], numbers[1], numbers[2]}; }

// Parses numbers with commas between them. Throws Error unless there are `count` finite ones.
std::vector<double> parse_numbers(const std::string& text, std::size_t count,
                                  const std::string& what) {
  std::vector<double> numbers;
  for (const std::string& word : CLI::detail::split(text, ',')) {
    double number = std::numeric_limits<double>::quiet_NaN();
    if (CLI::detail::lexical_cast(word, number) && std::isfinite(number)) numbers.push_back(number);
  }
  if (numbers.size() == count && std::ranges::count(text, ',') + 1 == std::ssize(numbers))
    return numbers;
  throw Error(fmt::format("'{}' is not {}", text, what));
}

std::optional<Levelling> levelling_of(const ExportArguments& arguments, const Model& model) {
  if (arguments.level.empty()) return std::nullopt;
  if (arguments.level == kFound) return output::found_levelling(model, arguments.model);
  const auto angles =
      parse_numbers(arguments.level, 2, "PITCH,X_TILT in degrees, or 'found' (--level)");
  return Levelling{.pitch_deg = angles[0], .x_tilt_deg = angles[1]};
}

double voxel_px_of(const ExportArguments& arguments, const Model& model) {
  return base::whole_if_near(arguments.voxel_size_A ? *arguments.voxel_size_A / model.pixel_size_A
                                                    : arguments.bin);
}

OrientedBox box_between_corners(const std::string& corners, double voxel_px) {
  const std::vector<double> numbers =
      parse_numbers(corners, 6,
                    "x0,y0,z0,x1,y1,z1 (--box); the side of boxes alone is for "
                    "--particles");
  const field::Point low = point(numbers.data()), high = point(numbers.data() + 3);
  for (std::size_t a = 0; a < 3; ++a) {
    const double voxels = (high[a] - low[a]) / voxel_px;
    if (voxels > 0 && voxels <= field::kMostVoxelsAlongAxis) continue;
    throw Error(fmt::format(
        "--box has {} from {} to {}, {:.6g} voxels: {}", "xyz"[a], low[a], high[a], voxels,
        voxels > 0 ? fmt::format("at most {} are allowed", field::kMostVoxelsAlongAxis)
                   : "give x0,y0,z0,x1,y1,z1 with the low corner first"));
  }
  return field::box_between(low, high, voxel_px);
}

// Returns the place that the user describes.
exchange::ExportPlace exported_place(const ExportArguments& arguments, const Model& model) {
  const auto& angles = arguments.rotation;
  const field::Rotation rotation =
      angles.empty() ? field::kNoRotation
                     : field::rotation_from_euler(angles[0], angles[1], angles[2]);
  exchange::ExportPlace place{.voxel_px = voxel_px_of(arguments, model),
                              .level = levelling_of(arguments, model)};
  if (!arguments.size.empty())
    place.box = {.centre_px = point(arguments.centre.data()),
                 .size = {arguments.size[0], arguments.size[1], arguments.size[2]},
                 .voxel_px = place.voxel_px};
  else if (!arguments.box.empty())
    place.box = box_between_corners(arguments.box, place.voxel_px);
  else if (!angles.empty())
    place.box = output::tomogram_box(model, place.voxel_px);
  if (place.box) place.box->field_from_box = rotation;
  return place;
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
  const std::size_t num_bytes = output::coded_file_size(*model.coded, model);
  io::OutputSet results;
  output::save_model(arguments.compact, model);
  results.commit();
  print(
      "{}: {} parameters in {} leaves, {} bytes; the densities change by {:.4g} times their "
      "standard deviation\n",
      arguments.compact.string(), made.report.parameters, model.field->tree().num_leaves(),
      num_bytes, std::sqrt(made.report.mean_square_change / made.report.variance));
}

void export_volume(const ExportArguments& arguments, const Model& model) {
  const exchange::ExportPlace place = exported_place(arguments, model);
  exchange::export_volume(model, exchange::box_in_field(model, place), files_of(arguments));
  const OrientedBox box = place.box.value_or(output::tomogram_box(model, place.voxel_px));
  const bool is_xzy = arguments.choices.options.volume.axes == VolumeAxes::kXzy;
  print("{}: {} × {} × {} voxels ({}) of {:.6g} Å about {:.6g}, {:.6g}, {:.6g} px\n",
        arguments.output.string(), box.size[0], box.size[is_xzy ? 2 : 1], box.size[is_xzy ? 1 : 2],
        is_xzy ? "x, z, y" : "x, y, z", box.voxel_px * model.pixel_size_A, box.centre_px[0],
        box.centre_px[1], box.centre_px[2]);
}

// Returns the side of the boxes of particles in voxels, or 0 if it is no whole number.
std::int64_t side_of(const ExportArguments& arguments) {
  if (arguments.box.empty()) return 0;
  const double side =
      parse_numbers(arguments.box, 1, "the side of the boxes in voxels (--box N)").front();
  const bool is_side = side == std::floor(side) && side >= 1 && side <= field::kMostVoxelsAlongAxis;
  return is_side ? static_cast<std::int64_t>(side) : 0;
}

void export_particles(const ExportArguments& arguments, const Model& model) {
  const exchange::ParticleBoxes boxes{
      .size = side_of(arguments),
      .voxel_px = voxel_px_of(arguments, model),
      .levelling = levelling_of(arguments, model).value_or(Levelling{})};
  const auto [count, num_beyond] =
      exchange::export_particles(model, boxes, arguments.tomogram, files_of(arguments));
  print("{}: {} particle{} in boxes of {}³ voxels of {:.6g} Å; the list is {}\n",
        arguments.output.string(), count, count == 1 ? "" : "s", boxes.size,
        boxes.voxel_px * model.pixel_size_A, exchange::particle_star(arguments.output).string());
  if (num_beyond == 0) return;
  print(
      "{} of the {} boxes reach outside the region that was reconstructed: what lies there is a "
      "guess, or 0\n",
      num_beyond, count);
}

void run_export(ExportArguments& arguments) {
  if (arguments.output.empty() && arguments.compact.empty())
    throw Error("nothing to write: give -o VOLUME.mrc, or --compact MODEL.h5");
  const std::vector<io::OutputLock> locks = claim_output(arguments);
  if (!arguments.compact.empty()) return write_compact(arguments);
  const Model model = output::load_undecoded(arguments.model);
  arguments.particles.empty() ? export_volume(arguments, model)
                              : export_particles(arguments, model);
}

void add_box_options(CLI::App& command, ExportArguments& arguments) {
  const char* group = "Box (pixels of the tomogram of the whole binned view, z from 0 up)";
  const CLI::Validator finite(
      [](std::string& text) {
        return std::isfinite(std::strtod(text.c_str(), nullptr)) ? "" : text + " is not finite";
      },
      "", "finite");
  CLI::Option* box =
      command
          .add_option("--box", arguments.box,
                      "Corners of the box (default: the region of interest and the whole "
                      "thickness); with --particles, the side of their boxes in voxels")
          ->type_name("X0,Y0,Z0,X1,Y1,Z1 or N")
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
                          ->check(number_between(1, field::kMostVoxelsAlongAxis))
                          ->needs(centre)
                          ->group(group);
  centre->needs(size);
  CLI::Option* rotate =
      command
          .add_option(
              "--rotate", arguments.rotation,
              "RELION's Euler angles in degrees (rlnAngleRot, rlnAngleTilt, rlnAnglePsi). The "
              "box turns about its centre, so that a particle appears in the orientation of "
              "its reference")
          ->delimiter(',')
          ->expected(3)
          ->type_name("ROT,TILT,PSI")
          ->check(finite)
          ->group(group);
  command
      .add_option("--level", arguments.level,
                  "Turn a tilted specimen back by what --align found, or by two angles in degrees, "
                  "as --tilt-offset PITCH and --x-axis-tilt X_TILT would")
      ->type_name("found|PITCH,X_TILT")
      ->excludes(rotate)
      ->check([](const std::string& text) {
        return text.empty() ? std::string("give 'found', or PITCH,X_TILT in degrees") : "";
      })
      ->group(group);

  const CLI::Validator positive = number_between(1e-3, 1e6);
  CLI::Option* voxel_size = command
                                .add_option("--voxel-size,--angpix", arguments.voxel_size_A,
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
      "Write any box of a model, at any voxel size and orientation, as an MRC volume; or cut out "
      "particles; or make a model compact");
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
  CLI::Option* particles =
      command
          ->add_option(
              "--particles", arguments->particles,
              "Cut out particles (STAR of RELION 5, or text of model2point) into one stack "
              "of subvolumes, with a STAR file beside it")
          ->type_name("FILE")
          ->excludes(compact);
  command
      ->add_option("--tomogram", arguments->tomogram,
                   "Whose particles to take, if the file has those of several tomograms "
                   "(rlnTomoName; default: the name of the model)")
      ->type_name("NAME")
      ->needs(particles);
  add_groups(*command, arguments->choices, {option_table::Group::kVolume});
  for (const char* of_volume : {"--center", "--rotate", "--zarr", "--axes"})
    particles->excludes(command->get_option(of_volume));
  for (const char* of_volume :
       {"--box", "--center", "--rotate", "--level", "--voxel-size", "--bin", "--zarr", "--axes"})
    compact->excludes(command->get_option(of_volume));
  add_common_options(*command);
  add_help_all(*command);
  command->callback([arguments] { run_stoppable([&] { run_export(*arguments); }); });
}

}  // namespace tomofield::cli
