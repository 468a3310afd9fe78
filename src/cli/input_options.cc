#include "cli/input_options.h"

#include <cmath>
#include <string>

namespace tomofield::cli {
namespace {

using tilt_series::TiltSeriesOptions;

void add_alignment_options(CLI::App& command, TiltSeriesOptions& options) {
  const char* group = "Tilt angles and alignment";
  command
      .add_option("--tlt", options.tlt,
                  "Tilt angles, one in degrees a line and section (.tlt or .rawtlt); wins over "
                  "the angles of every other file")
      ->type_name("FILE")
      ->group(group);
  command
      .add_option("--xf", options.xf,
                  "IMOD's raw-to-aligned transforms (.xf), for a raw stack; leave it out for a "
                  "stack that is aligned already")
      ->type_name("FILE")
      ->group(group);
  command
      .add_option("--xtilt", options.xtilt,
                  "IMOD's x-axis tilts, one in degrees a section (.xtilt)")
      ->type_name("FILE")
      ->group(group);
  command
      .add_option("--aln", options.aln,
                  "AreTomo's alignment (.aln), for the raw stack: angles, rotation, shifts and "
                  "dark frames")
      ->type_name("FILE")
      ->group(group);
  command
      .add_option("--mdoc", options.mdoc,
                  "SerialEM's metadata (.mdoc): angles, and the pixel size if the stack has none")
      ->type_name("FILE")
      ->group(group);
  command
      .add_option("--exclude", options.exclude,
                  "Sections to leave out, counted from 1, as in 1-3,40")
      ->type_name("LIST")
      ->group(group);
}

void add_image_options(CLI::App& command, TiltSeriesOptions& options) {
  const char* group = "Images";
  command
      .add_option("--bin", options.bin, "Reduce the views by this factor, 1 or more, whole or not")
      ->type_name("FACTOR")
      ->capture_default_str()
      ->group(group);
  command.add_option("--angpix", options.angpix, "Reduce the views to this pixel size instead")
      ->type_name("Å")
      ->group(group);
  command
      .add_option("--pixel-size", options.pixel_size_A,
                  "Size of the stack's own pixels, where its header has none or a wrong one")
      ->type_name("Å")
      ->group(group);
  command
      .add_option_function<std::string>(
          "--contrast",
          [&options](const std::string& contrast) {
            options.contrast = contrast == "dark" ? Contrast::kDark : Contrast::kBright;
          },
          "How the specimen looks: dark on bright, as a cryo microscope records it, or "
          "bright on dark, as dark-field images and line integrals are")
      ->check(CLI::IsMember({"dark", "bright"}))
      ->default_str("dark")
      ->group(group);
  command
      .add_flag("--log", options.take_log,
                "Take the logarithm of the transmitted intensity instead of its linear "
                "approximation (with --contrast dark)")
      ->group(group);
}

/// "auto", or a diameter in nm, 0 or more.
std::string bead_diameter_fault(const std::string& word) {
  if (word == "auto") return {};
  double diameter_nm = 0.0;
  if (CLI::detail::lexical_cast(word, diameter_nm) && diameter_nm >= 0.0 &&
      std::isfinite(diameter_nm)) {
    return {};
  }
  return "must be auto or a diameter in nm, 0 or more, not " + word;
}

void add_mask_options(CLI::App& command, TiltSeriesOptions& options) {
  const char* group = "Masks";
  command
      .add_option_function<std::string>(
          "--bead-diameter",
          [&options](const std::string& word) {
            if (word != "auto") options.bead_diameter_nm = std::stod(word);
          },
          "Diameter of the gold beads, which are found and masked in every view; auto: "
          "estimated, and only with --contrast dark and where there clearly are some; 0: none")
      ->check(CLI::Validator(bead_diameter_fault, "auto|NM"))
      ->default_str("auto")
      ->group(group);
  command
      .add_option("--fiducials", options.fiducials,
                  "Places of beads to mask as well: IMOD's fiducial model of this stack as text "
                  "(model2point, with or without -object or -contour)")
      ->type_name("FILE")
      ->group(group);
  command
      .add_option("--mask", options.mask,
                  "MRC stack of the same size as the tilt series: pixels that are 0 there are "
                  "left out, all others count")
      ->type_name("FILE")
      ->group(group);
}

}  // namespace

void add_series_options(CLI::App& command, TiltSeriesOptions& options) {
  add_alignment_options(command, options);
  add_image_options(command, options);
  add_mask_options(command, options);
}

void add_input_options(CLI::App& command, TiltSeriesOptions& options) {
  command.add_option("stack", options.stack, "Tilt series: an MRC stack, raw or aligned")
      ->type_name("STACK")
      ->required();
  add_series_options(command, options);
}

}  // namespace tomofield::cli
