#pragma once

#include <complex>
#include <cstdint>
#include <filesystem>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "base/volume.h"
#include "evaluate/box.h"
#include "tomofield/options.h"

namespace tomofield::evaluate {

/// Computes the discrete Fourier transform in three dimensions, in place and not normalised:
///   values[u] ← Σ_x values[x] exp(−2πi Σ_axis u x / n).
/// `values` is [z, y, x] in single precision. Any size works; products of small primes are fast.
void transform_volume(const base::Shape3& shape, std::vector<std::complex<float>>& values);

/// Returns the frequency of an index in cycles over an axis of n samples: 0, 1 … −1, the order of
/// numpy's fftfreq.
inline std::int64_t signed_frequency(std::int64_t index, std::int64_t n) {
  return index < (n + 1) / 2 ? index : index - n;
}

/// The tilts that a single-axis series about Y covers, in degrees.
struct TiltRange {
  double low_deg = 0.0, high_deg = 0.0;
  VolumeAxes axes = VolumeAxes::kXyz;  ///< of the volumes that are compared
  /// Returns true if a view of the series measured the frequency (kx, ky, kz), for any ky. The view
  /// at θ shows x = X cos θ + Z sin θ, and so the frequencies along (cos θ, sin θ).
  bool covers(double kx, double kz) const;
  /// Does the same for a frequency along the axes of the file. In xzy, rows count down along Z.
  bool covers(double kx, double ky, double kz) const {
    return axes == VolumeAxes::kXyz ? covers(kx, kz) : covers(kx, -ky);
  }
};

/// The Fourier shell correlation over one set of Fourier voxels. Entry s − 1 belongs to shell s;
/// the shells count from 1.
struct FscCurve {
  std::vector<double> correlation;   ///< NaN where a shell is empty
  std::vector<std::int64_t> voxels;  ///< Fourier voxels of the shell, k and −k both counted
};

/// The curves and their frequencies.
struct Fsc {
  std::vector<double> frequency_per_A;  ///< one a shell, up to the Nyquist frequency
  FscCurve all;
  std::optional<FscCurve> measured, missing;  ///< inside the tilt range; missing wedge
};

/// Returns the default weights of the voxels. The window falls to zero as a raised cosine over the
/// outer eighth of every axis at either end. Without it, the faces of the box, where the volume
/// breaks off, would be a detail that both volumes share.
base::Volume edge_window(const base::Shape3& shape);

/// The sums over the Fourier voxels of a shell.
struct ShellSums {
  double product = 0.0, first = 0.0, second = 0.0;
  std::int64_t voxels = 0;
  void operator+=(const ShellSums& other) {
    product += other.product;
    first += other.first;
    second += other.second;
    voxels += other.voxels;
  }
};

/// Adds up the shells of several pairs of boxes of one shape, as of the blocks of large volumes.
class FscSums {
 public:
  /// Adds a pair of boxes, as fourier_shell_correlation() compares them. A pair of which one box is
  /// constant under the weights counts for nothing. Throws Error as that function does otherwise.
  void add(const base::Volume& first, const base::Volume& second, const base::Volume& weights,
           const std::optional<TiltRange>& tilts);
  /// Returns the correlation over all pairs. Throws Error if none counts.
  Fsc correlation() const;

 private:
  double unit_of_first_ = 0.0, unit_of_second_ = 0.0;  // scales of the first pair
  double length_A_ = 0.0;                              // of the longest axis
  bool has_tilts_ = false;
  std::vector<ShellSums> measured_, missing_;  // [shell]
};

/// Computes the Fourier shell correlation (Harauz and van Heel, Optik 73, 1986)
///   FSC(s) = Σ Re(A conj B) / √(Σ |A|² Σ |B|²)
/// over the Fourier voxels with |k| within half a shell of s. A shell is as wide as one Fourier
/// pixel of the longest axis. |k| is in cycles a voxel, so shells are spheres whatever the sizes of
/// the axes. A and B are the transforms of w (v − mean of v under w), where w is `weights`, from 0
/// to 1.
///
/// All three volumes have the same shape. Sums are in double and in a fixed order, whatever the
/// thread count. Throws Error for volumes that are constant under the weights, that hold NaN or
/// infinite voxels, for weights outside of [0, 1], and for axes too short for a shell.
Fsc fourier_shell_correlation(const base::Volume& first, const base::Volume& second,
                              const base::Volume& weights, const std::optional<TiltRange>& tilts);

/// Tells whether the first shell of a curve that has a number is below `threshold`.
bool starts_below(const FscCurve& curve, double threshold);

/// Returns the resolution in Å at which a curve first falls below `threshold` on the way from low
/// to high frequencies. It interpolates linearly in frequency between the shells. Returns nothing
/// if the curve never falls below the threshold or starts below it.
std::optional<double> crossing_A(std::span<const double> frequency_per_A, const FscCurve& curve,
                                 double threshold);

/// Returns the correlation at a resolution in Å, linear in frequency between the nearest shells
/// that are not empty; nothing if the resolution lies beyond the first or the last of them.
std::optional<double> correlation_at(std::span<const double> frequency_per_A, const FscCurve& curve,
                                     double resolution_A);

/// The two files to correlate and the voxels of them that count.
struct FscFiles {
  std::filesystem::path first, second;
  std::optional<std::filesystem::path> mask;  ///< default: edge_window()
  std::optional<base::Box> box;               ///< in voxels of the second
  std::optional<TiltRange> tilts;
};

/// Computes the shell correlation of two MRC volumes, read as a pair (volume_pair.h). The mask is
/// an MRC volume of the size of the second, with weights from 0 to 1. Where the second's header has
/// no voxel size, frequencies count voxels, and a warning goes to base/log.h. Throws Error for
/// volumes that cannot be correlated, and if memory is too small.
Fsc correlate_files(const FscFiles& files);

/// The resolutions in Å at which fsc_json() states each curve's correlation: the size of a complex,
/// and about the finest that a tomogram with voxels of 10 Å shows.
inline constexpr double kCoarse_A = 100.0, kFine_A = 30.0;

/// Returns a table with a line a shell: its frequency, its resolution, and the correlation and the
/// number of Fourier voxels of each curve. An empty shell has an empty correlation.
std::string fsc_csv(const Fsc& fsc);

}  // namespace tomofield::evaluate
