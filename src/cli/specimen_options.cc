#include "cli/specimen_options.h"

#include <vector>

namespace tomofield::cli {

namespace {

const char* const kGroup = "Specimen (unbinned pixels of the aligned view)";

}  // namespace

void add_specimen_options(CLI::App& command, reconstruct::SpecimenOptions& options) {
  command.add_option("--thickness", options.thickness, "thickness of the tomogram along Z")
      ->required()
      ->group(kGroup);
  add_place_options(command, options);
}

void add_place_options(CLI::App& command, reconstruct::SpecimenOptions& options) {
  command
      .add_option_function<std::vector<long>>(
          "--roi",
          [&options](const std::vector<long>& v) {
            options.roi = {v[0], v[1], v[2], v[3]};
          },
          "x0,y0,x1,y1: region of interest at zero tilt; default: the whole field of view")
      ->delimiter(',')
      ->expected(4)
      ->type_name("INT,INT,INT,INT")
      ->group(kGroup);
  command.add_option("--hand", options.hand, "1: x = X cos + Z sin; -1: mirrored in Z")
      ->check(CLI::IsMember({1, -1}))
      ->capture_default_str()
      ->group(kGroup);
  command
      .add_option_function<std::vector<double>>(
          "--center",
          [&options](const std::vector<double>& v) {
            options.axis_x = v[0];
            if (v.size() > 1) options.axis_z = v[1];
          },
          "x[,z] of the tilt axis on the view and in the volume, pixel i covering [i, i+1); "
          "default: the centres")
      ->delimiter(',')
      ->expected(1, 2)
      ->type_name("FLOAT[,FLOAT]")
      ->group(kGroup);
  command
      .add_flag_callback(
          "--no-margin", [&options] { options.with_margin = false; },
          "the specimen ends inside the field of view: model nothing outside")
      ->group(kGroup);
}

}  // namespace tomofield::cli
