#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "base/volume.h"

namespace tomofield::evaluate {

/// Tilts that a single-axis series about Y covers, in degrees, low to high.
struct TiltRange {
  double low_deg = 0.0, high_deg = 0.0;
  /// Whether a view of the series measured the frequency (kx, ky, kz) for any ky:
  /// the view at θ shows x = X cos θ + Z sin θ, and so the frequencies along (cos θ, sin θ).
  bool covers(double kx, double kz) const;
};

/// Fourier shell correlation of one set of Fourier voxels. Shell s, from 1 on,
/// is entry s − 1 of everything.
struct FscCurve {
  std::vector<double> correlation;   ///< NaN where a shell is empty
  std::vector<std::int64_t> voxels;  ///< Fourier voxels of the shell, k and −k both counted
};

/// Curves and what they are drawn over.
struct Fsc {
  std::vector<double> frequency_per_A;  ///< of each shell, up to the Nyquist frequency
  FscCurve all;
  std::optional<FscCurve> measured, missing;  ///< within the tilt range, and in the missing wedge
};

/// Weights of the voxels by default: a window that falls to zero over the outer
/// eighth of every axis at either end as a raised cosine, so that the faces of the box,
/// where the volume breaks off, are no detail that both volumes share.
base::Volume edge_window(const base::Shape3& shape);

/// Fourier shell correlation (Harauz and van Heel, Optik 73, 1986)
///   FSC(s) = Σ Re(A conj B) / √(Σ |A|² Σ |B|²)
/// over the Fourier voxels with |k| within half a shell of s; a shell is one
/// Fourier pixel of the longest axis wide, and |k| is in cycles a voxel, so that
/// shells are spheres whatever the sizes of the axes. A and B are the transforms of
/// w (v − mean of v under w), with `weights` w between 0 and 1.
///
/// All of the same shape. Sums are in double and in a fixed order, whatever the
/// thread count. Throws Error for volumes that are constant under the weights, that hold
/// NaN or infinite voxels, for weights outside of [0, 1], and for axes too short for a shell.
Fsc fourier_shell_correlation(const base::Volume& first, const base::Volume& second,
                              const base::Volume& weights, const std::optional<TiltRange>& tilts);

/// The resolution at which a curve first falls below `threshold` on the way from low to
/// high frequencies, in Å, linear in frequency between the shells; none if it never does or
/// starts below.
std::optional<double> crossing_A(std::span<const double> frequency_per_A, const FscCurve& curve,
                                 double threshold);

}  // namespace tomofield::evaluate
