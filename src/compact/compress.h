#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <memory>

#include "base/range.h"
#include "compact/budget.h"
#include "compact/coded_field.h"
#include "field/field.h"

namespace tomofield::compact {

/// The size and the change of a compressed field. Densities are in density units.
struct CompressionReport {
  std::size_t parameters = 0;  ///< whole numbers that the file holds
  std::size_t bytes = 0;       ///< of their codes
  /// Sum of squared changes, times the volume of a vertex, over the volume of the region. The sum
  /// is over the vertices that voxels of the region depend on: those inside it and those next to
  /// it.
  double mean_square_change = 0.0;
  double variance = 0.0;  ///< of the densities in the region of interest
  double decibels = 0.0;  ///< that the PSNR falls by, at most, on phantoms (docs/compact.md)
  double volume = 0.0;    ///< of the region, in cubic pixels
};

/// Returns the report of two parts of a field together.
CompressionReport joined(const CompressionReport& a, const CompressionReport& b);

/// Throws Error if a field changed by more than a budget of decibels may allow (kMostDecibels).
void require_likeness(const CompressionReport& report);

/// A field as factors that are few and have short codes.
struct CompactField {
  CodedField coded;
  std::unique_ptr<field::Field> field;  ///< what the codes stand for (decode_field)
  CompressionReport report;
};

/// Returns the bytes of a file that holds a coded field.
using FileSize = std::function<std::size_t(const CodedField&)>;

/// Replaces the vertices of a finished fit by factors in leaves of several sizes. The sides of
/// leaves and the ranks of their modes are chosen together: among candidates of every place of the
/// tree (place_tree.h) whose errors were measured (truncation.h), those with the smallest error
/// within the budget, or the smallest within the error (structure.h). Then the factors are rounded
/// (leaf_code.h) so that they keep within the budget.
///
/// `roi` is the region of interest, which a tomogram shows. The compact field is empty beyond it:
/// few views see what lies there, and the fit piles up in it what it cannot place.
///
/// Codes of several parts of a field can be joined (append()): `rows` are those of whole bands, no
/// leaf becomes larger than a root cell, and a change in decibels counts against `variance`, which
/// is that of all parts.
///
/// `vertices` is of kind "grid", and all leaves must be kept. A place is worked on alone, so memory
/// is that of the vertices, of a place for each thread, and of the result.
///
/// The model is within the budget. A budget in bytes is that of the whole file, whose size
/// `file_size` returns; without it, that of the codes alone. Throws Error if none is found within a
/// budget in bytes or in parameters, or, for a whole field, as require_likeness() does. For a
/// budget in decibels, up to eight models of finer and finer rounding are made; if none is within
/// it, the last model is returned, and `report.decibels` is above the budget.
CompactField compress(const field::Field& vertices, const Rectangle& roi, const Budget& budget,
                      const FileSize& file_size = {});
CompactField compress(const field::Field& vertices, const Rectangle& roi, const Budget& budget,
                      base::Range rows, double variance, const FileSize& file_size = {});

/// Returns the variance of the densities in the region of interest of a field of plain vertices.
double variance_of(const field::Field& vertices, const Rectangle& roi);

}  // namespace tomofield::compact
