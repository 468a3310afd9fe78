#include "cli/volume_options.h"

#include <map>
#include <string>

namespace tomofield::cli {

void add_volume_options(CLI::App& command, output::VolumeOptions& options) {
  const char* group = "Volume";
  const std::map<std::string, io::MrcMode> modes{
      {"2", io::MrcMode::kFloat32}, {"12", io::MrcMode::kFloat16}, {"1", io::MrcMode::kInt16}};
  const std::map<std::string, VolumeAxes> axes{{"xyz", VolumeAxes::kXyz},
                                               {"xzy", VolumeAxes::kXzy}};
  command
      .add_option_function<std::string>(
          "--mode", [&options, modes](const std::string& mode) { options.mode = modes.at(mode); },
          "MRC mode: 2 float, 12 half float, 1 scaled 16-bit integers")
      ->check(CLI::IsMember({"2", "12", "1"}))
      ->default_str("2")
      ->group(group);
  command
      .add_option_function<std::string>(
          "--axes", [&options, axes](const std::string& order) { options.axes = axes.at(order); },
          "order in the file: xyz, or xzy as IMOD's tilt writes (same hand)")
      ->check(CLI::IsMember({"xyz", "xzy"}))
      ->default_str("xyz")
      ->group(group);
  command.add_flag("--invert", options.invert, "write the other contrast than the input's")
      ->group(group);
}

}  // namespace tomofield::cli
