#pragma once

#include <cstddef>
#include <string>
#include <vector>

#include "tilt_series/image.h"

namespace tomofield::tilt_series {

/// What stays at one place of the detector in all views, whatever lies in the beam. All members are
/// in the frame of the stack, unbinned, and empty where there is no such pattern.
struct FixedPattern {
  std::vector<std::vector<float>> columns;  ///< [view][x]: added to a column, in the stack's units
  std::vector<std::vector<float>> rows;     ///< [view][y]: added to a row
  std::vector<std::size_t> pixels;  ///< indices of single pixels that differ from those around

  bool is_empty() const { return columns.empty() && rows.empty() && pixels.empty(); }

  /// Subtracts the columns and rows from an image of the stack, and marks the single pixels as no
  /// measurements.
  void remove_from(std::size_t view, MaskedImage* image) const;
};

/// Sizes of a fixed pattern, for the log and the JSON.
struct FixedPatternMetrics {
  double column_deviation = 0.0;  ///< standard deviation over columns and views, the stack's units
  double row_deviation = 0.0;
  std::size_t num_pixels = 0;

  bool is_any() const { return column_deviation > 0.0 || row_deviation > 0.0 || num_pixels > 0; }
};

FixedPatternMetrics measure_pattern(const FixedPattern& pattern);
/// Returns a phrase that names what was found, for the log.
std::string describe_pattern(const FixedPatternMetrics& pattern);

}  // namespace tomofield::tilt_series
