#pragma once

#include <filesystem>
#include <vector>

namespace tomofield::report {

/// Draws the three central planes of an MRC volume: PREFIX_xy.png, PREFIX_xz.png and PREFIX_yz.png
/// (the file's own axes). The first axis of each name runs to the right, the second upwards, as in
/// 3dmod. One grey scale serves all three: black and white are the 0.5 and 99.5 percentiles of the
/// planes' finite values, densities as stored. Voxels stay square. Small volumes are enlarged,
/// whole pixels a voxel, until each picture is at least 512 pixels wide (unless another would then
/// be wider than 4096).
///
/// Reads the file once, rows at a time. Returns the three paths. Replaces files.
std::vector<std::filesystem::path> write_slice_pictures(const std::filesystem::path& mrc,
                                                        const std::filesystem::path& prefix);

}  // namespace tomofield::report
