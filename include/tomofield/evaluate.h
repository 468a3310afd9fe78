#pragma once

#include <tomofield/tomogram.h>

#include <cstdint>
#include <optional>
#include <vector>

namespace tomofield {

/// The similarity of a volume to the truth, voxel by voxel. "Affine" scores are those of scale ·
/// volume + offset, the least-squares fit to the truth.
struct VolumeScores {
  double psnr_raw_dB = 0.0;  ///< 10 log10(peak² / mean squared difference); infinite if equal
  double psnr_affine_dB = 0.0;
  double ssim_raw = 0.0;  ///< mean structural similarity, windows of 7 × 7 × 7 voxels
  double ssim_affine = 0.0;
  double correlation = 0.0;  ///< Pearson's
  double scale = 0.0, offset = 0.0;
  double peak = 0.0;  ///< max truth − min(0, min truth)
};

/// Scores a volume as `tomofield evaluate` does. Throws Error unless both have the same size, 7
/// voxels or more along each axis, voxels of one size if both state it, finite values, and a truth
/// that reaches above 0.
VolumeScores score_volume(const Tomogram& volume, const Tomogram& truth);

/// Fourier shell correlation, an entry a shell, from low to high frequencies.
struct ShellCorrelation {
  std::vector<double> frequency_per_A;  ///< up to the Nyquist frequency
  std::vector<double> correlation;      ///< NaN where a shell is empty
  std::vector<std::int64_t> voxels;     ///< Fourier voxels of the shell
};

/// Correlates two volumes as `tomofield evaluate --fsc` does, under a window that falls to zero
/// over the outer eighth of each axis. Voxel sizes are those of `second`. Throws Error unless both
/// have the same size, voxels of one size, and finite values that are not constant.
ShellCorrelation correlate_shells(const Tomogram& first, const Tomogram& second);

/// Returns the resolution in Å at which the correlation first falls below `threshold`; none if it
/// never does or starts below.
std::optional<double> resolution_A(const ShellCorrelation& curve, double threshold = 0.143);

}  // namespace tomofield
