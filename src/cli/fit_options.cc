#include "cli/fit_options.h"

#include <fmt/core.h>

#include <cmath>
#include <utility>

#include "cli/number_checks.h"

namespace tomofield::cli {
namespace {

constexpr const char* kGroup = "Fit";

}  // namespace

void add_view_scale(CLI::App& command, std::string& value) {
  command
      .add_option("--view-scale", value,
                  "fit a scale and an offset a view; auto: for dark contrast")
      ->check(CLI::IsMember({"auto", "on", "off"}))
      ->capture_default_str()
      ->group(kGroup);
}

void add_shared_fit_options(CLI::App& command, const SharedFitOptions& options) {
  constexpr double kMostViews = 1e9;
  add_view_scale(command, options.view_scale);
  command
      .add_option("--margin-spacing", options.margin_spacing,
                  "pixels between samples of the margin")
      ->check(number_between(1.0, 64.0))
      ->capture_default_str()
      ->group(kGroup);
  command
      .add_option("--hold-out", options.hold_out,
                  "leave every Nth view out of the fit and report how well it is predicted")
      ->check(number_between(2, kMostViews))
      ->group(kGroup);
}

void add_non_negative(CLI::App& command, std::string& value) {
  command
      .add_option("--non-negative", value,
                  "keep densities at or above zero (of dark contrast: nothing brighter than the "
                  "empty beam); auto: not for dark contrast, whose zero is uncertain")
      ->check(CLI::IsMember({"auto", "on", "off"}))
      ->capture_default_str()
      ->group("Method");
}

void add_seed(CLI::App& command, std::uint64_t& seed, const char* group) {
  command.add_option("--seed", seed, "of everything random")
      ->check(seed_check())
      ->capture_default_str()
      ->group(group);
}

bool is_on(const std::string& value, bool automatic) {
  return value == "on" || (value == "auto" && automatic);
}

void print_sizes(const Sizes& sizes) {
  std::int64_t ny = sizes.roi.height(), nz = std::llround(sizes.thickness);
  const bool swaps = sizes.axes == VolumeAxes::kXzy;
  if (swaps) std::swap(ny, nz);
  fmt::print("{} views of {} × {} pixels, {:.4g} Å; tomogram {} × {} × {} voxels{}\n",
             sizes.num_views, sizes.view_width, sizes.view_height, sizes.pixel_size_A,
             sizes.roi.width(), ny, nz, swaps ? " (x, z, y)" : "");
}

}  // namespace tomofield::cli
