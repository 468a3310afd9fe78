#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

#include "base/enum_names.h"
#include "tilt_series/fixed_pattern/fixed_pattern.h"

namespace tomofield::tilt_series {

/// The use of the pixels of beads that were found.
enum class BeadMasking {
  kNone,       ///< no beads were found, or nobody looked for them
  kMasked,     ///< they carry no loss
  kUndecided,  ///< they count until a decision is made; statistics leave them out
  kUnmasked,   ///< they count as all others do
};

/// Counts of what was masked beside the fill of rotated images.
struct MaskMetrics {
  std::size_t num_beads = 0;              ///< beads with one position in the specimen
  double bead_diameter_A = 0.0;           ///< given or estimated; 0: no beads
  std::vector<std::size_t> beads_found;   ///< [view]: beads with a spot of their own
  std::vector<std::size_t> beads_masked;  ///< [view]: discs, also from tracks and --fiducials
  BeadMasking bead_masking = BeadMasking::kNone;
  std::int64_t num_bad_pixels = 0;    ///< hot and dead pixels of all sections
  FixedPatternMetrics fixed_pattern;  ///< what was removed from all views
};

/// Describes the beads in a few words: "12 beads of 10 nm", or "no beads".
std::string describe_beads(const MaskMetrics& masks);

}  // namespace tomofield::tilt_series

template <>
struct tomofield::base::EnumNames<tomofield::tilt_series::BeadMasking> {
  using BeadMasking = tomofield::tilt_series::BeadMasking;
  static constexpr std::array kNames{std::pair{BeadMasking::kNone, "none"},
                                     std::pair{BeadMasking::kMasked, "masked"},
                                     std::pair{BeadMasking::kUndecided, "undecided"},
                                     std::pair{BeadMasking::kUnmasked, "unmasked"}};
};
