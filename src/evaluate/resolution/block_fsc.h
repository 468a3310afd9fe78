#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <optional>
#include <vector>

#include "base/volume.h"
#include "evaluate/resolution/fsc.h"

namespace tomofield::evaluate {

/// The blocks of correlate_blocks() have at most this many voxels on each axis.
constexpr std::int64_t kLargestBlock = 384;

/// Divides an axis into ranges of one length, at most `most`, that overlap as little as possible.
struct AxisBlocks {
  std::int64_t length = 0;
  std::vector<std::int64_t> begin;  ///< of each range
};
AxisBlocks divide_axis(std::int64_t n, std::int64_t most);

/// Computes the shell correlation of two MRC volumes of one size, block by block, with memory for
/// one block. The sums of fourier_shell_correlation() under edge_window() are added over the blocks
/// (Welch 1967), so volumes of at most `largest_block` voxels on each axis give what
/// correlate_files() gives. Larger ones give fewer shells.
Fsc correlate_blocks(const std::filesystem::path& first, const std::filesystem::path& second,
                     const std::optional<TiltRange>& tilts,
                     std::int64_t largest_block = kLargestBlock);

/// Returns the memory that correlate_blocks() takes.
std::size_t block_fsc_memory(const base::Shape3& shape);

}  // namespace tomofield::evaluate
