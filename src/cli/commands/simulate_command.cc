#include <fmt/format.h>

#include <charconv>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "base/code_text.h"
#include "cli/commands/commands.h"
#include "cli/options/common_options.h"
#include "cli/options/number_checks.h"
#include "cli/terminal/console.h"
#include "simulate/simulate_series.h"
#include "tilt_series/masks/series_masks.h"
#include "tomofield/error.h"

namespace tomofield::cli {
namespace {

struct SimulateArguments {
  std::string directory;
  simulate::SimulationOptions options;
  std::optional<simulate::Yardstick> yardstick;
  std::optional<std::int64_t> thickness_px;
  std::optional<std::string> tilts;
  std::optional<std::string> contrast;
  std::optional<std::string> defocus;
  std::optional<double> dose_per_tilt;
  std::vector<std::string> particles;
  std::optional<double> noise;
  std::optional<double> gain_spread;
  std::optional<std::int64_t> num_beads;
  std::optional<double> gold_density;
  double gold_diameter_A = 100.0;
  double magnification_percent = 0.0;
  bool without_truth = false;
  bool overwrite = false;
};

simulate::TiltRange parse_tilts(const std::string& text) {
  simulate::TiltRange tilts;
  const char* at = text.data();
  const char* const end = at + text.size();
  const auto take = [&](double& value, char separator) {
    const auto [next, fault] = std::from_chars(at, end, value);
    const bool ends_well = separator == '\0' ? next == end : next != end && *next == separator;
    if (fault != std::errc() || !ends_well)
      throw Error(
          fmt::format("--tilts is '{}': give first:last:step in degrees, as -60:60:2", text));
    at = separator == '\0' ? next : next + 1;
  };
  take(tilts.first_deg, ':');
  take(tilts.last_deg, ':');
  take(tilts.step_deg, '\0');
  return tilts;
}

/// Parses "LOW:HIGH", or one number, in µm.
simulate::Imaging::Range parse_defocus(const std::string& text) {
  const char* const end = text.data() + text.size();
  simulate::Imaging::Range range;
  auto [next, fault] = std::from_chars(text.data(), end, range.low_um);
  range.high_um = range.low_um;
  if (fault == std::errc() && next != end && *next == ':') {
    const auto high = std::from_chars(next + 1, end, range.high_um);
    next = high.ptr;
    fault = high.ec;
  }
  if (fault != std::errc() || next != end)
    throw Error(fmt::format("--defocus is '{}': give low:high in µm, as 3:5, or one number", text));
  return range;
}

/// Parses "FILE,COUNT".
simulate::ParticleFile parse_particles(const std::string& text) {
  const std::size_t comma = text.rfind(',');
  simulate::ParticleFile file;
  std::from_chars_result parsed{nullptr, std::errc::invalid_argument};
  const char* const end = text.data() + text.size();
  if (comma != std::string::npos)
    parsed = std::from_chars(text.data() + comma + 1, end, file.count);
  if (parsed.ec != std::errc() || parsed.ptr != end || comma == 0)
    throw Error(fmt::format(
        "--particles is '{}': give an MRC density and the number of its particles in the field of "
        "view, as ribosome.mrc,40",
        text));
  file.path = text.substr(0, comma);
  return file;
}

/// The contrast that is meant: counts of electrons are dark by nature.
Contrast resolve_contrast(const SimulateArguments& arguments) {
  const bool has_dose = arguments.options.dose.has_value();
  if (has_dose && arguments.contrast == "bright")
    throw Error(
        "--dose counts transmitted electrons, which is dark contrast: leave out --contrast "
        "bright");
  return has_dose || arguments.options.is_physical() || arguments.contrast == "dark"
             ? Contrast::kDark
             : Contrast::kBright;
}

/// Refuses options that contradict counts of electrons.
void require_counts(const SimulateArguments& arguments) {
  if (arguments.noise || arguments.options.dose)
    throw Error(
        "the noise of yardstick d is that of the electrons of --dose-per-tilt: leave out --noise "
        "and --dose");
  if (arguments.options.noise_blur_px > 0.0)
    throw Error("--noise-blur is for --noise: the counts of yardstick d are independent");
  if (arguments.contrast == "bright")
    throw Error(
        "yardstick d counts transmitted electrons, which is dark contrast: leave out --contrast "
        "bright");
}

/// Sets what a yardstick sets, from the yardstick and from the options that were given. An option
/// that was given wins over the yardstick's.
void resolve_specimen(SimulateArguments& arguments) {
  simulate::SimulationOptions& options = arguments.options;
  if (arguments.yardstick) {
    simulate::apply_yardstick(*arguments.yardstick, options);
    if (*arguments.yardstick == simulate::Yardstick::kD) require_counts(arguments);
  } else {
    options.tilts = arguments.tilts ? parse_tilts(*arguments.tilts)
                                    : simulate::default_tilts(options.cell.is_extended);
  }
  options.cell.thickness_px = arguments.thickness_px.value_or(options.cell.thickness_px);
  options.cell.num_beads = arguments.num_beads.value_or(options.cell.num_beads);
  options.cell.bead_density = arguments.gold_density.value_or(options.cell.bead_density);
  options.gain_spread = arguments.gain_spread.value_or(options.gain_spread);
}

/// Returns the command that reconstructs the series.
std::string how_to_reconstruct(const std::filesystem::path& directory,
                               const simulate::SimulationOptions& options) {
  const auto file = [&](const char* name) {
    return base::Shell::quoted_if_needed((directory / name).string());
  };
  std::string more = options.cell.is_extended ? "" : " --no-margin";
  if (options.is_physical())
    more +=
        fmt::format(" --ctf {} --mdoc {}", file("tilt_series_ctf.txt"), file("tilt_series.mdoc"));
  if (options.gain_spread > 0.0) more += " --view-scale on";
  if (options.cell.num_beads > 0) {
    const double diameter_px = options.cell.bead_diameter_px;
    const bool can_be_found =
        diameter_px <= tilt_series::largest_bead_px(static_cast<double>(options.cell.size_px));
    more += fmt::format(" --bead-diameter {:g}",
                        can_be_found ? diameter_px * options.voxel_size_A / 10.0 : 0.0);
  }
  return fmt::format(
      "reconstruct it with: tomofield reconstruct {} --tlt {}{} --thickness {} --contrast {}{} -o "
      "{}",
      file("tilt_series.mrc"), file("tilt_series.tlt"),
      options.misalignment.is_none() ? "" : " --xf " + file("tilt_series.xf"),
      options.cell.thickness_px, options.contrast == Contrast::kDark ? "dark" : "bright", more,
      file("tomogram.mrc"));
}

void run_simulate(SimulateArguments& arguments) {
  simulate::SimulationOptions& options = arguments.options;
  if (arguments.noise && options.dose)
    throw Error("--noise and --dose are two kinds of noise: give one of them");
  if (options.noise_blur_px > 0.0 && options.dose)
    throw Error("--noise-blur is for --noise: the counts of --dose are independent");
  resolve_specimen(arguments);
  if (!arguments.particles.empty() && !options.is_physical())
    throw Error("--particles is for --yardstick d: other phantoms have no proteins");
  for (const std::string& text : arguments.particles)
    options.particle_files.push_back(parse_particles(text));
  options.contrast = resolve_contrast(arguments);
  if (arguments.defocus) options.imaging.defocus = parse_defocus(*arguments.defocus);
  options.imaging.dose_per_tilt = arguments.dose_per_tilt.value_or(options.imaging.dose_per_tilt);
  options.noise = arguments.noise.value_or(options.noise);
  options.write_truth = !arguments.without_truth;
  options.misalignment.magnification_spread = arguments.magnification_percent / 100.0;
  options.cell.bead_diameter_px = arguments.gold_diameter_A / options.voxel_size_A;
  const auto summary = simulate::simulate_series(arguments.directory, options, arguments.overwrite);
  std::string line = fmt::format("{} ellipsoids", summary.num_ellipsoids);
  if (summary.num_blobs > 0) line += fmt::format(", {} Gaussian blobs", summary.num_blobs);
  line += fmt::format(", {} views", summary.num_views);
  if (summary.num_particles > 0) line += fmt::format(", {} particles", summary.num_particles);
  if (summary.num_beads > 0) line += fmt::format(", {} gold beads", summary.num_beads);
  if (summary.sigma) line += fmt::format(", sigma {:.4f}", *summary.sigma);
  if (options.is_physical())
    line += fmt::format(", {:.1f} electrons per pixel behind the ice at 0°", summary.empty_beam);
  if (options.dose) line += fmt::format(", {} electrons per pixel and view", *options.dose);
  if (summary.truth)
    line += fmt::format(", truth{} max {:.3f} mean {:.3f}",
                        options.reference_has_beads ? "" : " without gold", summary.truth->max,
                        summary.truth->mean);
  print("{}\n{}\n", line, how_to_reconstruct(arguments.directory, options));
}

void add_misalignment_options(CLI::App& command, SimulateArguments& arguments) {
  simulate::Misalignment& misalignment = arguments.options.misalignment;
  command
      .add_option("--misalign", misalignment.shift_spread_px,
                  "Standard deviation in pixels of each view's random shift in x and in y; an .xf "
                  "file undoes it and the next three options")
      ->capture_default_str();
  command
      .add_option("--misalign-rotation", misalignment.rotation_spread_deg,
                  "Standard deviation in degrees of each view's random rotation in the plane")
      ->capture_default_str();
  command
      .add_option("--misalign-magnification", arguments.magnification_percent,
                  "Standard deviation in percent of each view's random magnification")
      ->capture_default_str();
  command
      .add_option("--misalign-axis", misalignment.axis_deg,
                  "Rotation in degrees, counter-clockwise, of the tilt axis in all views")
      ->capture_default_str();
  command
      .add_option("--misalign-local", misalignment.local_px,
                  "Rms displacement in pixels by a smooth random warp of each view, which changes "
                  "slowly from view to view")
      ->capture_default_str();
  command
      .add_option(
          "--misalign-tilt", misalignment.tilt_spread_deg,
          "Standard deviation in degrees of the errors of the tilt angles in a .rawtlt file; "
          "the .tlt file has the true ones")
      ->capture_default_str();
}

void add_imaging_options(CLI::App& command, SimulateArguments& arguments) {
  simulate::Imaging& imaging = arguments.options.imaging;
  CLI::Option* defocus = command.add_option("--defocus", arguments.defocus,
                                            "Filter the views by a contrast transfer function, "
                                            "with an underfocus in µm that is drawn for "
                                            "each view (default: plain projections; with "
                                            "--yardstick d 2:4, drawn once, and views scatter "
                                            "by 0.15 µm)");
  defocus->type_name("LOW:HIGH");
  command
      .add_option("--astigmatism", imaging.astigmatism_um,
                  "Difference between the two defoci of a view in µm; its direction is drawn")
      ->needs(defocus)
      ->capture_default_str();
  command.add_option("--voltage", imaging.optics.voltage_kV, "Voltage of the microscope in kV")
      ->capture_default_str();
  command
      .add_option("--cs", imaging.optics.spherical_aberration_mm,
                  "Spherical aberration of the microscope in mm")
      ->needs(defocus)
      ->capture_default_str();
  command
      .add_option("--amplitude-contrast", imaging.optics.amplitude_contrast,
                  "Share of the contrast that is absorption, 0 to 1")
      ->needs(defocus)
      ->capture_default_str();
  command.add_option(
      "--dose-per-tilt", arguments.dose_per_tilt,
      "Electrons per Å² and view, in dose-symmetric order: radiation damage weakens the "
      "signal of late views (default: none; with --yardstick d 3)");
  command
      .add_option("--noise-blur", arguments.options.noise_blur_px,
                  "Blur the noise of --noise by a Gaussian with this standard deviation in pixels, "
                  "and keep its strength (0: white noise)")
      ->capture_default_str();
}

}  // namespace

void add_simulate_command(CLI::App& program) {
  auto arguments = std::make_shared<SimulateArguments>();
  simulate::SimulationOptions& options = arguments->options;
  CLI::App* command = program.add_subcommand(
      "simulate", "Make a cell phantom, its exact projections, and a noisy tilt series of it");
  command->add_option("directory", arguments->directory, "Directory for the files, made if absent")
      ->required();
  command->add_option("--size", options.cell.size_px, "Width and height in pixels")
      ->capture_default_str();
  command->add_option("--thickness", arguments->thickness_px,
                      "Thickness in voxels (default: 150; with --yardstick 75/128 of --size, with "
                      "--yardstick d 1120 Å)");
  command->add_option("--seed", options.cell.seed, "Seed of all random numbers")
      ->check(seed_check())
      ->capture_default_str();
  CLI::Option* extended =
      command->add_flag("--extended", options.cell.is_extended,
                        "The specimen continues outside the field of view, as in a microscope");
  CLI::Option* tilts = command->add_option(
      "--tilts", arguments->tilts,
      "Tilt angles in degrees (default: -70:69.5:1.5; with --extended -60:60:2)");
  tilts->type_name("FIRST:LAST:STEP");
  add_enum_option<simulate::Yardstick>(
      *command, "--yardstick", arguments->yardstick,
      "Phantom that the benchmarks use. a: a cell that ends in the field of view, 94 views from "
      "-70 to 69.5 degrees; b: an extended specimen, 61 views from -60 to 60 degrees; c: as b, "
      "with "
      "thin membranes, filaments, particles and texture, gold, and gains. Its truth has no gold; "
      "d: "
      "proteins, membranes, filaments and gold in ice in physical units, as counts of electrons in "
      "41 views from -60 to 60 degrees")
      ->excludes(extended, tilts);
  command
      ->add_option("--particles", arguments->particles,
                   "An MRC density, in which high is dense, and the number of its particles in the "
                   "field of view, in place of random proteins (with --yardstick d). Repeatable")
      ->type_name("FILE,COUNT");
  command->add_option("--voxel-size", options.voxel_size_A, "Voxel size in Å")
      ->capture_default_str();
  command->add_option(
      "--noise", arguments->noise,
      "Gaussian noise as a fraction of the range of the view at 0° (default: 0.05)");
  command->add_option("--dose", options.dose,
                      "Electrons per pixel and view: Poisson noise in place of --noise");
  command
      ->add_option("--absorption", options.absorption_per_A,
                   "Attenuation per unit of density and Å (with --dose)")
      ->capture_default_str();
  command
      ->add_option(
          "--contrast", arguments->contrast,
          "Contrast of the views (default: bright). bright: line integrals; dark: an empty "
          "beam minus the line integrals")
      ->check(CLI::IsMember({"dark", "bright"}));
  command->add_option(
      "--gain", arguments->gain_spread,
      "Standard deviation of the logarithm of each view's random scale (default: 0; "
      "with --yardstick c 0.03)");
  add_misalignment_options(*command, *arguments);
  add_imaging_options(*command, *arguments);
  command->add_option(
      "--gold", arguments->num_beads,
      "Number of gold beads in the field of view (default: 0; with --yardstick c 12 "
      "per 256 x 256 pixels)");
  command->add_option("--gold-diameter", arguments->gold_diameter_A, "Diameter of a gold bead in Å")
      ->capture_default_str();
  command->add_option(
      "--gold-density", arguments->gold_density,
      "Density of gold (the cell's densest walls have 1) (default: 5; with --yardstick d 25 V). 0: "
      "the same specimen without its beads");
  command->add_flag("--no-truth", arguments->without_truth, "Do not write truth.mrc");
  command->add_flag("--overwrite", arguments->overwrite, "Replace files that exist");
  add_common_options(*command);
  command->callback([arguments] { run_stoppable([&] { run_simulate(*arguments); }); });
}

}  // namespace tomofield::cli
