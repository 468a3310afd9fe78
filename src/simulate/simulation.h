#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "base/enum_names.h"
#include "geometry/raw_from_aligned.h"
#include "geometry/view_warp.h"
#include "simulate/cryo/density_file.h"
#include "simulate/imaging.h"
#include "simulate/misalignment.h"
#include "simulate/phantom.h"
#include "tilt_series/tilt_series.h"

namespace tomofield::simulate {

/// Angles first, first + step, … up to and including last, in degrees.
struct TiltRange {
  double first_deg = -70.0;
  double last_deg = 69.5;
  double step_deg = 1.5;
};
/// Returns the usual tilts of a bounded or an extended specimen.
TiltRange default_tilts(bool is_extended);

/// The phantoms that every score of the project refers to (docs/index.md).
enum class Yardstick {
  kA,  ///< a cell that ends in the field of view, in 94 views from −70° to 69.5°
  kB,  ///< a specimen that goes on outside it, in 61 views from −60° to 60°
  kC,  ///< as B, with textured content, gold beads, and gains that differ between views
  kD,  ///< a specimen in ice in physical units, as cryo-EM counts it (cryo/specimen.h)
};

/// Sets a simulated tilt series.
struct SimulationOptions {
  CellOptions cell;  ///< its max_tilt_deg is replaced by that of `tilts`
  TiltRange tilts;
  double voxel_size_A = 10.0;
  /// Standard deviation of the Gaussian noise, the same in all views, divided by the range (0.5 to
  /// 99.5 percentile) of the noise-free view nearest to zero tilt, at gain 1.
  double noise = 0.05;
  double noise_blur_px = 0.0;  ///< standard deviation of a Gaussian that blurs that noise; 0: white
  /// Electrons per pixel and view of an empty beam. If given, views are Poisson counts of mean
  /// dose · exp(−absorption · ∫ density) and have no Gaussian noise.
  std::optional<double> dose;
  /// Absorption per unit of density and Å. By default, the beam falls by a factor e over 0.3 µm of
  /// the slab (density 0.169), as it does in ice with an energy filter at 300 kV.
  double absorption_per_A = 0.002;
  /// True if the gold beads belong to what is measured: truth.mrc shows them, and the range that
  /// `noise` refers to includes them.
  bool reference_has_beads = true;
  double gain_spread = 0.0;  ///< standard deviation of the logarithm of each view's scale
  std::vector<ParticleFile> particle_files;  ///< of a physical specimen (cryo/specimen.h)
  Misalignment misalignment;
  Imaging imaging;
  Contrast contrast = Contrast::kBright;
  bool write_truth = true;

  /// Returns true if the series has counts of electrons of a specimen in physical units.
  bool is_physical() const { return cell.content == Content::kCryo; }

  /// Returns a sentence for each option that is out of range.
  std::vector<std::string> validate() const;
};

/// Turns `options` into those of a yardstick. It sets the kind of specimen, the tilts, and the
/// thickness, which is 75/128 of cell.size_px. For C it also sets a gain spread of 0.03 and 12 gold
/// beads for each 256 × 256 pixels, which are no part of the reference: a reconstruction masks
/// them. It leaves noise, seed and all else as they are.
///
/// For D it sets 41 views from −60° to 60°, an ice of 1120 Å, 3 electrons per Å² and view, an
/// underfocus of 2 to 4 µm that views scatter about by 0.15 µm, 8 gold beads of 25 V for each
/// 2560 × 2560 Å², and dark contrast.
void apply_yardstick(Yardstick yardstick, SimulationOptions& options);

/// The tilt, the alignment and the gain of a simulated view.
struct SimulatedView {
  double tilt_deg = 0.0;
  double tilt_error_deg = 0.0;  ///< of the angle that the microscope recorded
  geometry::RawFromAligned raw_from_aligned{};
  std::optional<geometry::ViewWarp> warp{};  ///< local motion
  double gain = 1.0;
  std::optional<io::Defocus> defocus{};  ///< of the recorded image, on the tilt axis
  microscope::Exposure exposure{};
};

/// Returns the views of a series: the tilts, and the random misalignment and gains of the seed.
std::vector<SimulatedView> plan_views(const SimulationOptions& options);

/// Converts line integrals into the intensities that a detector stores. Dark contrast without
/// counts stores empty_beam − ∫ density.
class Detector {
 public:
  explicit Detector(const SimulationOptions& options);
  /// Replaces line integrals by noise-free intensities.
  void expose(std::vector<float>& image, double gain) const;
  /// Returns the intensity without a specimen at gain 1. With counts it is the dose. With dark
  /// contrast it is the longest path through the slab times the largest density of a cell, which
  /// is 1. With bright contrast it is 0.
  double empty_beam() const { return empty_beam_; }

 private:
  bool counts_ = false;
  double empty_beam_ = 0.0;
  double absorption_per_px_ = 0.0;
  double sign_ = 1.0;
};

}  // namespace tomofield::simulate

namespace tomofield::base {

template <>
struct EnumNames<simulate::Yardstick> {
  static constexpr std::array kNames{
      std::pair{simulate::Yardstick::kA, "a"}, std::pair{simulate::Yardstick::kB, "b"},
      std::pair{simulate::Yardstick::kC, "c"}, std::pair{simulate::Yardstick::kD, "d"}};
};

}  // namespace tomofield::base
