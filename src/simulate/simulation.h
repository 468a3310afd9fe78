#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "simulate/phantom.h"
#include "tilt_series/tilt_series.h"

namespace tomofield::simulate {

/// Angles first, first + step, … up to and including last, in degrees.
struct TiltRange {
  double first_deg = -70.0;
  double last_deg = 69.5;
  double step_deg = 1.5;
};
TiltRange default_tilts(bool is_extended);

/// Names the two phantoms that every score of the project refers to (docs/index.md).
enum class Yardstick {
  kA,  ///< a cell that ends in the field of view, in 94 views from −70° to 69.5°
  kB,  ///< a specimen that goes on outside it, in 61 views from −60° to 60°
};

/// What a simulated tilt series shall be.
struct SimulationOptions {
  CellOptions cell;  ///< max_tilt_deg is taken from `tilts`, whatever it says
  TiltRange tilts;
  double voxel_size_A = 10.0;
  /// Gaussian noise, the same in all views: standard deviation over the range
  /// (0.5 to 99.5 percentile) of the noise-free view nearest to zero tilt.
  double noise = 0.05;
  /// Electrons per pixel and view of an empty beam: Poisson counts of
  /// dose · exp(−absorption · ∫ density), instead of Gaussian noise.
  std::optional<double> dose;
  /// Per unit of density and Å. The default makes the slab (0.169) lose a
  /// factor e over 0.3 µm, as ice does with an energy filter at 300 kV.
  double absorption_per_A = 0.002;
  double gain_spread = 0.0;      ///< standard deviation of the logarithm of each view's scale
  double shift_spread_px = 0.0;  ///< standard deviation of each view's shift, in x and in y
  Contrast contrast = Contrast::kBright;
  bool write_truth = true;

  /// Everything that is wrong, one sentence each; empty if nothing is.
  std::vector<std::string> validate() const;
};

/// Turns `options` into those of a yardstick. It sets the kind of specimen, the tilts, and the
/// thickness, which is 75/128 of cell.size_px. It leaves noise, seed and all else as they are.
void apply_yardstick(Yardstick yardstick, SimulationOptions& options);

/// What befell one view.
struct SimulatedView {
  double tilt_deg = 0.0;
  double shift_x_px = 0.0;  ///< of the specimen in the image; thousandths, as .xf has them
  double shift_y_px = 0.0;
  double gain = 1.0;
};

/// The views of a series: angles, and the random shifts and gains of the seed.
std::vector<SimulatedView> plan_views(const SimulationOptions& options);

/// The intensity that a detector stores for line integrals. Dark contrast
/// without counts is empty_beam − ∫.
class Detector {
 public:
  explicit Detector(const SimulationOptions& options);
  /// Noise-free intensities in place of line integrals.
  void expose(std::vector<float>& image, double gain) const;
  /// What no specimen at all would give at gain 1: the dose; the longest path
  /// through the slab times the largest density of a cell, 1; or 0 if bright.
  double empty_beam() const { return empty_beam_; }

 private:
  bool counts_ = false;
  double empty_beam_ = 0.0;
  double absorption_per_px_ = 0.0;
  double sign_ = 1.0;
};

}  // namespace tomofield::simulate
