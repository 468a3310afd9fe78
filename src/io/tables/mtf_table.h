#pragma once

#include <filesystem>
#include <vector>

namespace tomofield::io {

/// The part of the signal that a detector passes, at rising frequencies.
struct MtfTable {
  std::vector<double> frequencies;  ///< cycles per pixel of the detector, rising
  std::vector<double> values;       ///< at each frequency; 1: all of the signal
};

/// Reads a STAR file as RELION takes it (rlnMtfFileName), with the columns
/// rlnResolutionInversePixel and rlnMtfValue. Throws Error with the file and the row for what is
/// missing or cannot be.
MtfTable read_mtf(const std::filesystem::path& path);

}  // namespace tomofield::io
