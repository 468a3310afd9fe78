#pragma once

#include <cstdint>
#include <span>
#include <vector>

namespace tomofield::simulate {

/// Returns the phase in rad that an electron wave gains per V of potential and Å of path:
/// σ = 2π m e λ / h², relativistic; 6.53e-4 at 300 kV.
double interaction_per_VA(double voltage_kV);

/// Turns filtered projections of potential into expected counts of electrons.
///
/// A pixel of area a expects n = dose · a · exp(−T / (Λ cos θ)) electrons behind ice of the
/// thickness T, where Λ = 3000 Å is the mean free path of inelastic scattering, which an energy
/// filter removes (at 300 kV measured as 2800 to 3950 Å: Yan et al., J. Struct. Biol. 192, 2015;
/// Rice et al., J. Struct. Biol. 204, 2018). Contrast is that of a weak phase object,
/// n (1 − 2 σ H p), where H p is the projection of the potential filtered by −CTF, in V Å. Counts
/// are not negative: gold is no weak object.
class ElectronCounts {
 public:
  struct Settings {
    double dose_per_A2 = 3.0;
    double pixel_size_A = 10.0;
    double thickness_A = 1120.0;
    double voltage_kV = 300.0;
  };
  explicit ElectronCounts(const Settings& settings) : settings_(settings) {}

  /// Returns the expected electrons of a pixel without a specimen in the ice.
  double behind_ice(double tilt_deg) const;
  /// Replaces filtered projections, in V · pixels, by expected counts.
  void expose(std::span<float> image, double tilt_deg, double gain) const;

 private:
  Settings settings_;
};

/// The counts of a view, and those of the even and the odd frames, whose sum they are.
struct FrameCounts {
  std::vector<float> all, even, odd;
};

/// Draws counts with these expected values, [y, x]. Each electron falls into the even or the odd
/// frames with equal chance, so both halves are independent Poisson counts of half the expectation.
/// It takes two streams a row from `first_stream` on.
FrameCounts draw_frames(std::span<const float> expected, std::int64_t width, std::uint64_t seed,
                        std::uint64_t first_stream);

}  // namespace tomofield::simulate
