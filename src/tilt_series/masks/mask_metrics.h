#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

#include "base/enum_names.h"
#include "tilt_series/fixed_pattern/fixed_pattern.h"

namespace tomofield::tilt_series {

/// A round part of a view that hides a bead or a fiducial.
struct MaskDisc {
  double x_px = 0.0;  ///< pixel i covers [i, i + 1)
  double y_px = 0.0;
  double radius_px = 0.0;
};

/// Calls body(x, y) for each pixel of an image of width × height pixels whose centre lies in the
/// disc.
template <typename Body>
void for_pixels_in(const MaskDisc& disc, std::int64_t width, std::int64_t height,
                   const Body& body) {
  const auto low = [&](double at) {
    return std::max<std::int64_t>(static_cast<std::int64_t>(std::floor(at - disc.radius_px)), 0);
  };
  const auto high = [&](double at, std::int64_t size) {
    return std::min(static_cast<std::int64_t>(std::ceil(at + disc.radius_px)), size);
  };
  for (std::int64_t y = low(disc.y_px); y < high(disc.y_px, height); ++y) {
    for (std::int64_t x = low(disc.x_px); x < high(disc.x_px, width); ++x) {
      const double distance = std::hypot(static_cast<double>(x) + 0.5 - disc.x_px,
                                         static_cast<double>(y) + 0.5 - disc.y_px);
      if (distance <= disc.radius_px) body(x, y);
    }
  }
}

/// The place of a bead in a view, in pixels; pixel i covers [i, i + 1).
struct BeadSpot {
  std::size_t view = 0;
  double x_px = 0.0, y_px = 0.0;
};

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
