#pragma once

#include <array>
#include <cstdint>
#include <filesystem>
#include <vector>

#include "base/volume.h"
#include "evaluate/resolution/fsc.h"

namespace tomofield::evaluate {

/// Side of the windows of local_resolution(), in voxels, and the distance between them.
constexpr std::int64_t kResolutionWindow = 32, kResolutionStep = 8;
/// The correlation at which a window's curve gives its resolution.
constexpr double kLocalThreshold = 0.5;

/// The local resolution at the centres of windows, as frequencies in cycles a voxel.
struct LocalResolution {
  std::array<std::vector<double>, 3> centre_px;  ///< of the windows, along each axis of the file
  std::vector<float> frequency;                  ///< [z, y, x] of the windows

  /// Returns the frequency at the centre of a voxel: linear between windows, and constant beyond
  /// the outermost ones.
  float at(std::int64_t x, std::int64_t y, std::int64_t z) const;
  /// Returns the resolution in voxels of which a part of all windows has a finer one.
  double percentile_px(double per_cent) const;
};

/// Measures how far into fine details two halves agree around each place: the Fourier shell
/// correlation of the voxels in a window, for windows everywhere (Cardone, Heymann and Steven,
/// J. Struct. Biol. 184, 226, 2013).
///
/// A window is 32 voxels wide, or as wide as the volume where that is thinner, and falls to its
/// faces as a raised cosine along each axis. The mean under the window is subtracted. Shells are
/// 1/32 cycle a voxel apart. Each correlation takes the sums of its shell and its two neighbours,
/// because a shell of one window has few independent numbers, and only frequencies that the tilts
/// cover. The frequency at which it first falls below 0.5 counts, linear between shells: 1/2 if it
/// never does, and 1/32 if the first shell is below or if a half is constant.
///
/// The volumes are MRC files of one size. A few sections of them are in memory at a time.
LocalResolution local_resolution(const std::filesystem::path& first,
                                 const std::filesystem::path& second, const TiltRange& tilts);

/// Writes the resolution in Å at every voxel, in a file with the header of `like`.
void write_local_resolution(const LocalResolution& resolution, const std::filesystem::path& like,
                            const std::filesystem::path& path);

/// Returns about the memory that local_resolution() takes.
std::size_t local_resolution_memory(const base::Shape3& shape);

}  // namespace tomofield::evaluate
