#pragma once

#include <string>
#include <vector>

#include "geometry/raw_from_aligned.h"
#include "tomofield/options.h"
#include "verdict/verdict.h"

namespace tomofield::verdict {

/// The input of the user that warnings judge.
struct GivenInput {
  Contrast contrast = Contrast::kDark;
  /// Where the pixels of each aligned view come from in the stack.
  std::vector<geometry::RawFromAligned> alignment = {};
  std::vector<double> tilt_deg = {};  ///< of each view
  std::vector<double> residual = {};  ///< of each view, as Verdict::residual; 0: not fitted
  double thickness = 0.0;             ///< in pixels of the fit
  double bin_factor = 1.0;            ///< of these pixels to the stack's
  Alignment aligned_before = Alignment::kOff;  ///< RunOptions::align
  /// Options of the fit, as on the command line, that are far from what any series needs.
  std::vector<std::string> extreme_settings = {};
};

/// Returns what is off in a run, the most serious first. Faults of the series as a whole (views
/// that show nothing, contrast, order, alignment, axis) come alone, because nothing else can be
/// judged then; a fit that is bad for no reason that is known is named last. The
/// limits rest on the measurements in docs/results/archive/verdict.md.
std::vector<Warning> find_warnings(const Verdict& verdict, const GivenInput& input);

}  // namespace tomofield::verdict
