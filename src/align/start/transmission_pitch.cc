#include "align/start/transmission_pitch.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <numbers>
#include <vector>

#include <Eigen/Core>
#include <Eigen/QR>

#include "geometry/tilt_geometry.h"

namespace tomofield::alignment {
namespace {

constexpr double kDegree = std::numbers::pi / 180.0;
constexpr double kMostPitch = 20.0 * kDegree, kSteepest = 85.0 * kDegree;
// Electrons go 200 to 400 nm through ice before they are lost. The thickness is known roughly.
constexpr double kShortestPath_A = 1000.0, kLongestPath_A = 8000.0;
constexpr double kDrift = 0.01;  // of the exposure from an end of the tilts to the other
constexpr double kMostRest =
    0.1;                     // of the logarithm of the intensity, beyond which this is no layer
constexpr int kRounds = 12;  // of least squares
constexpr double kSettled = 0.01 * kDegree;  // length of the last step
constexpr std::size_t kGroups = 8;           // of neighbouring tilts, left out in turn

// A layer that lets exp(−thickness / cos(tilt + pitch)) of the beam through. The thickness is in
// mean free paths, and the pitch in radians.
struct Layer {
  double log_beam = 0.0, thickness = 0.0, pitch = 0.0;
  double rest = 0.0;  // root mean square of what is left of the logarithms
};

// The logarithms of the intensities of some views.
struct Transmissions {
  std::vector<double> tilt, log_intensity;
};

// Returns the layer after a step of least squares from a pitch. A first step has no thickness to
// tell the pitch by, and finds this alone.
Layer step_of_fit(const Transmissions& views, const Layer& from) {
  const std::ptrdiff_t n = std::ssize(views.tilt), unknowns = from.thickness == 0.0 ? 2 : 3;
  Eigen::MatrixXd columns(n, unknowns);
  for (std::ptrdiff_t i = 0; i < n; ++i) {
    const double tilt = views.tilt[static_cast<std::size_t>(i)] + from.pitch;
    columns(i, 0) = 1.0;
    columns(i, 1) = -1.0 / std::cos(tilt);
    if (unknowns == 3) columns(i, 2) = -from.thickness * std::tan(tilt) / std::cos(tilt);
  }
  const Eigen::Map<const Eigen::VectorXd> logs(views.log_intensity.data(), n);
  const Eigen::VectorXd best = columns.colPivHouseholderQr().solve(logs);
  const double squares = (logs - columns * best).squaredNorm();
  return {best[0], best[1], from.pitch + (unknowns == 3 ? best[2] : 0.0),
          std::sqrt(squares / static_cast<double>(n))};
}

// Returns the layer that explains the views best, unless they lead to none.
std::optional<Layer> layer_of(const Transmissions& views) {
  Layer layer;
  double step = 1.0;
  for (int round = 0; round < kRounds; ++round) {
    const Layer next = step_of_fit(views, layer);
    if (!(next.thickness > 0.0) || !(std::abs(next.pitch) < kMostPitch)) return std::nullopt;
    for (const double tilt : views.tilt)
      if (std::abs(tilt + next.pitch) > kSteepest) return std::nullopt;
    step = std::abs(next.pitch - layer.pitch);
    layer = next;
  }
  if (step > kSettled || layer.rest > kMostRest) return std::nullopt;
  return layer;
}

// Returns the views without one of the groups of neighbouring tilts. They are in order of tilt.
Transmissions without_group(const Transmissions& views, std::size_t group) {
  Transmissions rest;
  for (std::size_t i = 0; i < views.tilt.size(); ++i) {
    if (i * kGroups / views.tilt.size() == group) continue;
    rest.tilt.push_back(views.tilt[i]);
    rest.log_intensity.push_back(views.log_intensity[i]);
  }
  return rest;
}

// Returns the variance of the pitch by the jackknife (Quenouille 1956, Tukey 1958): what is not
// explained changes slowly over the tilts.
std::optional<double> variance_of_pitch(const Transmissions& views) {
  std::vector<double> pitches;
  for (std::size_t group = 0; group < kGroups; ++group) {
    const auto layer = layer_of(without_group(views, group));
    if (!layer) return std::nullopt;
    pitches.push_back(layer->pitch);
  }
  const Eigen::Map<const Eigen::ArrayXd> values(pitches.data(), std::ssize(pitches));
  return (values - values.mean()).square().sum() * (kGroups - 1) / kGroups;
}

// Returns by how much a drift of the exposure changes the pitch: both make the ends differ.
double error_by_drift(const Transmissions& views, const Layer& layer) {
  const auto path = [&](double tilt) { return 1.0 / std::cos(tilt + layer.pitch); };
  const auto change = [&](double tilt) { return path(tilt) * std::tan(tilt + layer.pitch); };
  const double ends = layer.thickness * (change(views.tilt.back()) - change(views.tilt.front()));
  return kDrift / std::abs(ends);
}

}  // namespace

std::optional<FoundPitch> pitch_by_transmission(std::span<const double> tilt_deg,
                                                std::span<const double> intensities,
                                                double thickness_A) {
  if (tilt_deg.size() < 2 * kGroups) return std::nullopt;
  Transmissions views;
  for (const std::size_t view : geometry::order_of_tilts(tilt_deg)) {
    if (!(intensities[view] > 0.0)) return std::nullopt;
    views.tilt.push_back(tilt_deg[view] * kDegree);
    views.log_intensity.push_back(std::log(intensities[view]));
  }
  const auto layer = layer_of(views);
  if (!layer) return std::nullopt;
  const double path_A = thickness_A / layer->thickness;
  if (path_A < kShortestPath_A || path_A > kLongestPath_A) return std::nullopt;
  const auto variance = variance_of_pitch(views);
  if (!variance) return std::nullopt;
  return FoundPitch{layer->pitch / kDegree,
                    std::hypot(std::sqrt(*variance), error_by_drift(views, *layer)) / kDegree};
}

}  // namespace tomofield::alignment
