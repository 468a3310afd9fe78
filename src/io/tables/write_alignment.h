#pragma once

#include <filesystem>
#include <span>

#include "io/tables/alignment_files.h"

namespace tomofield::io {

// Writers of the files that alignment_files.h reads. Each makes its text the whole contents of
// `path` and throws Error if that cannot be written. Reading a file gives what was written, rounded
// to the decimals that are stated.

/// Writes a .tlt or .xtilt file: one angle in degrees a line, with four decimals. There is one for
/// each section, and none is beyond ±360°.
void write_number_column(const std::filesystem::path& path, std::span<const double> angles_deg);

/// Writes an .xf file: one line a section, with seven decimals for the matrix and three for the
/// shifts, which are in unbinned pixels.
void write_imod_transforms(const std::filesystem::path& path,
                           std::span<const ImodTransform> transforms);

/// Writes SerialEM's .mdoc with what the Mdoc has: pixel spacing, stack, and for each section the
/// tilt angle, the dose and the dose before it, all with four decimals.
void write_mdoc(const std::filesystem::path& path, const Mdoc& mdoc);

/// Writes AreTomo's .aln file without local alignment. Rotations have five decimals,
/// magnifications five, shifts three and tilts four. The thickness has three and is written if it
/// is there. The columns SMEAN, SFIT, SCALE and BASE, which describe AreTomo's own images, are 1,
/// 1, 1 and 0. Preconditions: there is at least one row and a raw size, and every dark section has
/// a tilt.
///
/// Numbers of sections are written as they stand. Those from 1 on are safe: where AreTomo does not
/// know the section of a dark frame, it writes 0.
void write_aretomo_alignment(const std::filesystem::path& path, const AreTomoAlignment& alignment);

}  // namespace tomofield::io
