#include "cli/options/fit_options.h"

#include <cmath>
#include <string>
#include <string_view>
#include <utility>

#include "baseline/method_options.h"
#include "cli/options/help_formatter.h"
#include "cli/options/table_options.h"
#include "cli/terminal/console.h"
#include "record/plan_record.h"

namespace tomofield::cli {
namespace {

// Returns the voxels along the axes of the file.
std::array<std::int64_t, 3> voxels_of(const Sizes& sizes) {
  std::array<std::int64_t, 3> voxels{sizes.roi.width(), sizes.roi.height(),
                                     std::llround(sizes.thickness)};
  if (sizes.axes == VolumeAxes::kXzy) std::swap(voxels[1], voxels[2]);
  return voxels;
}

}  // namespace

void add_shared_fit_options(CLI::App& command, option_table::Choices& choices) {
  for (const std::string_view key : baseline::kSharedFitKeys) add_row(command, key, choices);
}

void add_non_negative(CLI::App& command, std::optional<bool>& value) {
  command
      .add_option_function<std::string>(
          "--non-negative",
          [&value](const std::string& text) {
            value = text == "auto" ? std::nullopt : std::optional(text == "on");
          },
          std::string(baseline::kNonNegativeHelp))
      ->check(CLI::IsMember({"auto", "on", "off"}))
      ->type_name("auto|on|off")
      ->default_str(std::string(baseline::kNonNegativeDefault))
      ->group("Method");
}

void print_sizes(const Sizes& sizes) {
  const auto [nx, ny, nz] = voxels_of(sizes);
  print("{} views of {} × {} pixels, {:.4g} Å; tomogram {} × {} × {} voxels{}\n", sizes.num_views,
        sizes.view_width, sizes.view_height, sizes.pixel_size_A, nx, ny, nz,
        sizes.axes == VolumeAxes::kXzy ? " (x, z, y)" : "");
}

void add_grid_option(CLI::App& command, std::optional<std::filesystem::path>& file) {
  command
      .add_option("--grid", file, "Also write the voxels of the tomogram to a file, for programs")
      ->type_name("FILE.json")
      ->needs("--dry-run")
      ->group(kHelpAllGroup);
}

void write_grid(const std::filesystem::path& file, const Sizes& sizes,
                std::vector<std::filesystem::path> results) {
  record::write_planned_volume(file, {{voxels_of(sizes), sizes.pixel_size_A}, std::move(results)});
}

}  // namespace tomofield::cli
