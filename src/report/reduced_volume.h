#pragma once

#include <array>
#include <cstdint>
#include <functional>
#include <span>
#include <vector>

#include "io/images/mrc.h"

namespace tomofield::report {

/// Returns the size at which a volume is shown that may have no more than `most_voxels`, and no
/// more than 4096 along an axis: its own, or smaller by one factor on all axes.
std::array<std::int64_t, 3> reduced_size(const io::MrcHeader& header, std::int64_t most_voxels);

/// Receives a section of a reduced volume: `values` are [y, x]. It is called from several threads
/// at once.
using SectionSink = std::function<void(std::int64_t section, std::span<const float> values)>;

/// Reduces a volume to `size`, no axis of which is larger than the volume's. A voxel is the mean of
/// the voxels that it covers, of which some count in part. Voxels that are not finite count as 0.
/// Reads sections one after another and holds two of the reduced sections a thread.
void reduce_volume(const io::MrcReader& volume, const std::array<std::int64_t, 3>& size,
                   const SectionSink& sink);

/// Returns finite voxels of up to 32 evenly spaced sections, at most four million of them.
std::vector<float> sample_voxels(const io::MrcReader& volume);

}  // namespace tomofield::report
