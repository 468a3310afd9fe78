#include "cli/specimen_options.h"

#include <fmt/format.h>

#include <string>

#include "cli/number_checks.h"

namespace tomofield::cli {

namespace {

const char* const kGroup = "Specimen (unbinned pixels of the aligned view)";

CLI::Validator words_check(const char* wanted, bool (*is_one)(const std::string&)) {
  return {[wanted, is_one](std::string& text) -> std::string {
            if (is_one(text)) return {};
            return fmt::format("must be {}; not '{}'", wanted, text);
          },
          ""};
}

}  // namespace

void add_specimen_options(CLI::App& command, measurement::SpecimenOptions& options) {
  command.add_option("--thickness", options.thickness, "thickness of the tomogram along Z")
      ->required()
      ->group(kGroup);
  add_place_options(command, options);
}

void add_place_options(CLI::App& command, measurement::SpecimenOptions& options) {
  command
      .add_option_function<std::string>(
          "--roi",
          [&options](const std::string& text) {
            const auto v = *parse_whole_numbers(text);
            options.roi = {v[0], v[1], v[2], v[3]};
          },
          "x0,y0,x1,y1: region of interest at zero tilt; default: the whole field of view")
      ->check(words_check("four whole numbers, x0,y0,x1,y1",
                          [](const std::string& text) {
                            const auto v = parse_whole_numbers(text);
                            return v && v->size() == 4;
                          }))
      ->type_name("INT,INT,INT,INT")
      ->group(kGroup);
  command.add_option("--hand", options.hand, "1: x = X cos + Z sin; -1: mirrored in Z")
      ->check(CLI::IsMember({1, -1}))
      ->capture_default_str()
      ->group(kGroup);
  command
      .add_option_function<std::string>(
          "--center",
          [&options](const std::string& text) {
            const auto v = *parse_numbers(text);
            options.axis_x = v[0];
            if (v.size() > 1) options.axis_z = v[1];
          },
          "x[,z] of the tilt axis on the view and in the volume, pixel i covering [i, i+1); "
          "default: the centres")
      ->check(words_check("one or two numbers, x or x,z",
                          [](const std::string& text) {
                            const auto v = parse_numbers(text);
                            return v && (v->size() == 1 || v->size() == 2);
                          }))
      ->type_name("FLOAT[,FLOAT]")
      ->group(kGroup);
  command
      .add_flag_callback(
          "--no-margin", [&options] { options.with_margin = false; },
          "the specimen ends inside the field of view: model nothing outside")
      ->group(kGroup);
}

}  // namespace tomofield::cli
