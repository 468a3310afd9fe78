#include "cli/options/fit_options.h"

#include <cmath>
#include <string>
#include <utility>

#include "cli/options/number_checks.h"
#include "cli/options/table_options.h"
#include "cli/terminal/console.h"

namespace tomofield::cli {

void add_shared_fit_options(CLI::App& command, option_table::Choices& choices) {
  for (const char* key : {"fit.fit_view_scale", "field.margin_spacing", "fit.hold_out"})
    add_row(command, key, choices);
}

void add_non_negative(CLI::App& command, std::optional<bool>& value) {
  command
      .add_option_function<std::string>(
          "--non-negative",
          [&value](const std::string& text) {
            value = text == "auto" ? std::nullopt : std::optional(text == "on");
          },
          "Keep densities at or above zero: with dark contrast nothing is brighter than the empty "
          "beam")
      ->check(CLI::IsMember({"auto", "on", "off"}))
      ->type_name("auto|on|off")
      ->default_str("off for dark contrast, whose zero is uncertain, else on")
      ->group("Method");
}

void add_seed(CLI::App& command, std::uint64_t& seed, const char* group) {
  command.add_option("--seed", seed, "Seed of all random numbers")
      ->check(seed_check())
      ->capture_default_str()
      ->group(group);
}

void print_sizes(const Sizes& sizes) {
  std::int64_t ny = sizes.roi.height(), nz = std::llround(sizes.thickness);
  const bool swaps = sizes.axes == VolumeAxes::kXzy;
  if (swaps) std::swap(ny, nz);
  print("{} views of {} × {} pixels, {:.4g} Å; tomogram {} × {} × {} voxels{}\n", sizes.num_views,
        sizes.view_width, sizes.view_height, sizes.pixel_size_A, sizes.roi.width(), ny, nz,
        swaps ? " (x, z, y)" : "");
}

}  // namespace tomofield::cli
