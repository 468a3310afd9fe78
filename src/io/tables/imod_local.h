#pragma once

#include <cstdint>
#include <filesystem>
#include <vector>

#include "io/tables/alignment_files.h"

namespace tomofield::io {

/// How IMOD aligns one part of one section beyond the alignment of all of it.
struct ImodLocalPart {
  double tilt_deg = 0.0;    ///< is added to the tilt angle
  double x_tilt_deg = 0.0;  ///< is added to the x-axis tilt
  /// Moves projections that are made with these angles: p = A q + shift, both from the centre of
  /// the aligned image.
  ImodTransform transform;
};

/// IMOD's local alignments (LOCALFILE of tilt.com, written by tiltalign): a regular grid of places
/// of the specimen. Lengths are pixels of the images that were aligned.
struct ImodLocal {
  std::int64_t columns = 0, rows = 0;
  /// Place of the first column and row, as a pixel of the aligned image that counts from 1, and the
  /// distance between columns and rows.
  double first_x_px = 0.0, first_y_px = 0.0, step_x_px = 1.0, step_y_px = 1.0;
  double pixel_size_A = 0.0;  ///< 0: not in the file
  std::int64_t num_sections = 0;
  std::vector<ImodLocalPart> parts{};  ///< [row, column, section]
};

/// Reads such a file for a stack of `num_sections`. Its factors of height (Z factors) are skipped:
/// IMOD applies them with ZFACTORFILE alone. Throws Error if the file has another number of
/// sections, with the line where lines or numbers are missing, and for a number that cannot be.
ImodLocal read_imod_local(const std::filesystem::path& path, std::int64_t num_sections);

}  // namespace tomofield::io
