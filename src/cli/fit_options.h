#pragma once

#include <CLI/CLI.hpp>
#include <cstdint>
#include <string>

#include "geometry/tilt_geometry.h"
#include "output/volume.h"
#include "tomofield/options.h"

namespace tomofield::cli {

/// Options of every command that reconstructs, whatever the method.
struct SharedFitOptions {
  double& margin_spacing;
  int& hold_out;
  std::string& view_scale;  ///< auto, on or off: see is_on()
};

/// Registers --view-scale: auto, on or off.
void add_view_scale(CLI::App& command, std::string& value);
/// Registers --view-scale, --margin-spacing and --hold-out.
void add_shared_fit_options(CLI::App& command, const SharedFitOptions& options);

/// Registers --non-negative of a baseline: auto, on or off.
void add_non_negative(CLI::App& command, std::string& value);

/// Registers --seed in a group of options.
void add_seed(CLI::App& command, std::uint64_t& seed, const char* group);

/// The meaning of auto, on or off.
bool is_on(const std::string& value, bool automatic);

/// What is reconstructed from what.
struct Sizes {
  int num_views;
  std::int64_t view_width, view_height;
  double pixel_size_A;
  Rectangle roi;
  double thickness;
  VolumeAxes axes;
};
/// The first line of what a command says before it starts: the tomogram's sizes in the order of its
/// file. compare::planned_grid() reads it.
void print_sizes(const Sizes& sizes);

}  // namespace tomofield::cli
