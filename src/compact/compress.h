#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <memory>
#include <nlohmann/json.hpp>
#include <vector>

#include "compact/budget.h"
#include "field/field.h"

namespace tomofield::compact {

/// The codes of all leaves (leaf_code.h), one after the other.
struct LeafCodes {
  double step = 0.0;                 ///< of the densities' whole numbers
  std::vector<std::int64_t> offset;  ///< [leaf + 1] index in `bytes` of a leaf's first byte
  std::vector<std::uint8_t> bytes;
};

/// Says what a compression did. Densities are in density units.
struct CompressionReport {
  std::size_t parameters = 0;  ///< whole numbers that the file holds
  std::size_t bytes = 0;       ///< of their codes
  /// Sum of squared changes at all vertices, the margin's as well, over the volume of the region.
  double mean_square_change = 0.0;
  double variance = 0.0;  ///< of the densities in the region of interest
  double decibels = 0.0;  ///< that the PSNR falls by, at most, on phantoms (kErrorOverVariance)
};

/// Returns the report for the metrics of a run; `seconds` is what the compression took.
nlohmann::json report_json(const CompressionReport& report, double seconds);

/// A field as factors that are few and have short codes.
struct CompactField {
  std::unique_ptr<field::Field> field;  ///< of kind "vm", as the codes say
  LeafCodes codes;
  CompressionReport report;
};

/// The part of the densities' variance that stands for the mean squared error of a fit, whose truth
/// is unknown. It was measured on phantoms, so that the PSNR of none falls by more than a budget in
/// decibels says (docs/results/compact.md).
inline constexpr double kErrorOverVariance = 0.3;

/// Replaces the vertices of a finished fit by factors in leaves of several sizes. The sides of
/// leaves and the ranks of their modes are chosen together: among candidates of every place of the
/// tree (place_tree.h) whose errors were measured (truncation.h), those with the smallest error
/// within the budget, or the smallest within the error (structure.h). Then the factors are rounded
/// (leaf_code.h) so that they keep within the budget.
///
/// `vertices` is of kind "grid", and all leaves must be kept. A place is worked on alone, so memory
/// is that of the vertices, of a place for each thread, and of the result. Throws Error if a budget
/// in bytes or parameters cannot be met.
CompactField compress(const field::Field& vertices, const Budget& budget);

}  // namespace tomofield::compact
