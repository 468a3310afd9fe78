#include "simulate/misalignment.h"

#include <cmath>
#include <numbers>

#include "base/random.h"
#include "geometry/raw_from_aligned.h"

namespace tomofield::simulate {
namespace {

using geometry::RawFromAligned;
using geometry::ViewWarp;

constexpr std::uint64_t kShiftStream = 4;
constexpr std::uint64_t kRotationStream = 9;
constexpr std::uint64_t kMagnificationStream = 10;
constexpr std::uint64_t kLocalStream = 11;
constexpr std::uint64_t kTiltStream = 12;
constexpr double kMatrixUnit = 1e7;  // an .xf file has 7 decimals for the matrix
constexpr double kShiftUnit = 1e3;   // and 3 for the shift
constexpr double kCorrelation = 0.9;

double round_to(double unit, double value) { return std::round(value * unit) / unit; }

// Returns the map that an .xf file tells of `map`.
RawFromAligned as_written(const RawFromAligned& map) {
  io::ImodTransform line = geometry::invert(map);
  for (double* const entry : {&line.a11, &line.a12, &line.a21, &line.a22})
    *entry = round_to(kMatrixUnit, *entry);
  for (double* const entry : {&line.shift_x_px, &line.shift_y_px})
    *entry = round_to(kShiftUnit, *entry);
  return geometry::invert(line);
}

double rms_displacement(const std::vector<ViewWarp>& warps) {
  double squares = 0.0;
  for (const ViewWarp& warp : warps) squares += warp.mean_square();
  return std::sqrt(squares / static_cast<double>(warps.size()));
}

}  // namespace

std::vector<RawFromAligned> draw_maps(const Misalignment& misalignment, std::uint64_t seed,
                                      std::size_t num_views) {
  base::Random shifts(seed, kShiftStream);
  base::Random rotations(seed, kRotationStream);
  base::Random magnifications(seed, kMagnificationStream);
  const auto draw_shift = [&] {
    return round_to(kShiftUnit, misalignment.shift_spread_px * shifts.normal());
  };
  std::vector<RawFromAligned> maps(num_views);
  for (RawFromAligned& map : maps) {
    map.shift_x_px = draw_shift();
    map.shift_y_px = draw_shift();
    if (!misalignment.turns_or_scales()) continue;
    const double rotation_rad =
        (misalignment.axis_deg + misalignment.rotation_spread_deg * rotations.normal()) *
        std::numbers::pi / 180.0;
    const double scale = std::exp(misalignment.magnification_spread * magnifications.normal());
    map.m11 = map.m22 = scale * std::cos(rotation_rad);
    map.m21 = scale * std::sin(rotation_rad);
    map.m12 = -map.m21;
    map = as_written(map);
  }
  return maps;
}

std::vector<double> draw_tilt_errors(double spread_deg, std::uint64_t seed, std::size_t num_views) {
  base::Random random(seed, kTiltStream);
  std::vector<double> errors_deg;
  for (std::size_t view = 0; view < num_views; ++view)
    errors_deg.push_back(spread_deg * random.normal());
  return errors_deg;
}

std::vector<ViewWarp> draw_warps(double local_px, double size_px, std::uint64_t seed,
                                 std::size_t num_views) {
  base::Random random(seed, kLocalStream);
  std::vector<ViewWarp> warps(num_views, {.width_px = size_px, .height_px = size_px});
  for (std::size_t view = 0; view < num_views; ++view) {
    for (std::size_t node = 0; node < warps[view].nodes.size(); ++node) {
      for (std::size_t axis = 0; axis < 2; ++axis) {
        const double fresh = random.normal();
        warps[view].nodes[node][axis] =
            view == 0 ? fresh
                      : kCorrelation * warps[view - 1].nodes[node][axis] +
                            std::sqrt(1.0 - kCorrelation * kCorrelation) * fresh;
      }
    }
  }
  for (ViewWarp& warp : warps) warp = warp.without(warp.rigid_part());
  const double scale = local_px / rms_displacement(warps);
  for (ViewWarp& warp : warps) {
    for (auto& node : warp.nodes) {
      for (double& component : node) component *= scale;
    }
  }
  return warps;
}

}  // namespace tomofield::simulate
