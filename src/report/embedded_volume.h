#pragma once

#include <array>
#include <cstdint>
#include <filesystem>
#include <string>
#include <utility>
#include <vector>

namespace tomofield::report {

/// A volume that a page contains: reduced, with 8 bits a voxel, as pictures of many sections each.
struct EmbeddedVolume {
  std::array<std::int64_t, 3> size{};        ///< voxels of the reduced volume
  std::array<std::int64_t, 3> file_size{};   ///< voxels of the file
  double voxel_size_A = 0;                   ///< of the file; 0 if it does not say
  std::pair<double, double> limits{0, 1};    ///< values that 0 and 255 stand for
  std::pair<double, double> contrast{0, 1};  ///< values that are black and white at first
  std::array<std::int64_t, 2> tile{};        ///< pixels of a section in a sheet
  std::int64_t columns = 1, rows = 1;        ///< sections side by side in a sheet, and on top of
                                             ///< each other
  std::vector<std::string> sheets;           ///< JPEG, in the order of the sections
};

/// The most bytes that the sheets of a volume may have together.
inline constexpr std::size_t kMostSheetBytes = std::size_t{5} << 20;

/// Reduces an MRC volume to at most 40 million voxels and encodes it. Black and white are the
/// contrast of the volume (contrast.h), and the limits lie half of that range beyond. If the sheets
/// were larger than kMostSheetBytes, they are encoded with less quality. Holds one byte a reduced
/// voxel.
EmbeddedVolume embed_volume(const std::filesystem::path& mrc);

/// Returns what the script of the page reads (page/report.js), JSON. The sheets are base64.
std::string text_of(const EmbeddedVolume& volume);

}  // namespace tomofield::report
