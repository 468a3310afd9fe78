#pragma once

#include "geometry/raw_from_aligned.h"
#include "io/tables/view_table.h"

namespace tomofield::microscope {

/// The microscope, which all views of a series have in common.
struct Optics {
  double voltage_kV = 300.0;
  double spherical_aberration_mm = 2.7;
  double amplitude_contrast = 0.07;  ///< share of the contrast that is absorption, 0 to 1
  double b_factor_A2 = 0.0;          ///< of the envelope exp(−B k² / 4)
};

/// Returns the optics of pure absorption, which transfers everything in focus.
Optics without_phase_contrast(Optics optics);

/// Returns the wavelength of electrons, with the theory of relativity.
double electron_wavelength_A(double voltage_kV);

/// Describes the contrast transfer function of one view as CTFFIND4 defines it (Rohou and
/// Grigorieff, J. Struct. Biol. 192, 2015, equations 1 to 5):
///
///   CTF(k) = −sin(χ(k) + asin(amplitude contrast)) exp(−B k² / 4)
///   χ(k)   = π λ k² (Δf(α) − λ² k² Cs / 2) + phase shift
///   Δf(α)  = (u + v) / 2 + (u − v) / 2 · cos(2 (α − angle))
///
/// α is the direction of k, from x to y. Underfocus is positive. The function is negative at low
/// frequencies: what is dense is dark. A projection of density, in which dense is high, is filtered
/// by −CTF.
class Ctf {
 public:
  Ctf(const Optics& optics, const io::Defocus& defocus);

  /// Returns the function at a frequency, in cycles per Å along x and y. `more_defocus_A` is added
  /// to the underfocus in all directions, as for a part of a tilted view.
  double value(double kx, double ky, double more_defocus_A = 0.0) const;
  /// Returns the argument of the sine in it over 2π.
  double turns(double kx, double ky, double more_defocus_A = 0.0) const;
  /// Returns its envelope, where `k2` is the square of the frequency.
  double envelope(double k2) const;

  /// Returns a bound of |CTF| / envelope between two frequencies that are close to each other,
  /// where the underfocus is that of any direction and greater by `low_A` to `high_A`.
  double largest(double from, double to, double low_A, double high_A) const;

  /// Returns how far the function displaces what has frequencies up to `k`, in cycles per Å: a
  /// wave of frequency k moves by |dχ/dk| / 2π. The underfocus is that of the view, greater or
  /// smaller by up to `more_defocus_A`.
  double reach_A(double k, double more_defocus_A = 0.0) const;

  double wavelength_A() const { return wavelength_A_; }

 private:
  double turns_of(double defocus_A_k2, double k2) const;

  double wavelength_A_;
  double mean_defocus_A_, half_difference_A_;  // (u + v) / 2 and (u − v) / 2
  double cos_2angle_, sin_2angle_;
  double aberration_A3_;  // λ² Cs / 2
  double phase_turns_;    // phase shift and amplitude contrast, over 2π
  double quarter_b_factor_A2_;
};

/// Returns the defocus of a recorded image as the aligned view has it: the angle turns with the
/// image. Angles are counted from x to y in both, in the order in which pixels and rows are stored;
/// MRC files store the bottom row first, so this is counter-clockwise as IMOD, RELION and CTFFIND
/// show images. The magnification of the alignment, a percent or so, is not applied to the
/// frequencies. `map` is regular.
io::Defocus aligned_defocus(const io::Defocus& recorded, const geometry::RawFromAligned& map);

}  // namespace tomofield::microscope
