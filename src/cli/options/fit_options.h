#pragma once

#include <CLI/CLI.hpp>
#include <array>
#include <cstdint>
#include <filesystem>
#include <optional>

#include "geometry/tilt_geometry.h"
#include "option_table/values.h"
#include "tomofield/options.h"

namespace tomofield::cli {

/// Registers --view-scale, --margin-spacing and --hold-out, which every method has.
void add_shared_fit_options(CLI::App& command, option_table::Choices& choices);

/// Registers --non-negative of the baseline `tensorf`: auto (no value), on or off.
void add_non_negative(CLI::App& command, std::optional<bool>& value);

/// The sizes of the views and of the tomogram.
struct Sizes {
  int num_views;
  std::int64_t view_width, view_height;
  double pixel_size_A;
  Rectangle roi;
  double thickness;
  VolumeAxes axes;
};
/// Prints the first line of a plan: the number and the sizes of the views, and the sizes of the
/// tomogram in the order of its file.
void print_sizes(const Sizes& sizes);

/// Registers --grid, which goes with --dry-run.
void add_grid_option(CLI::App& command, std::optional<std::filesystem::path>& file);

/// Writes the voxels that the tomogram will have along the axes of its file, their size, and the
/// files that the run may write or remove, for programs (record::read_planned_volume()).
void write_grid(const std::filesystem::path& file, const Sizes& sizes,
                std::vector<std::filesystem::path> results);

}  // namespace tomofield::cli
