#pragma once

#include <vector>

#include "geometry/raw_from_aligned.h"
#include "reconstruct/verdict.h"
#include "tomofield/options.h"

namespace tomofield::reconstruction {

/// Holds what the user said of the series.
struct GivenInput {
  Contrast contrast = Contrast::kDark;
  /// Where the pixels of each aligned view come from in the stack.
  std::vector<geometry::RawFromAligned> alignment = {};
  double thickness = 0.0;   ///< in pixels of the fit
  double bin_factor = 1.0;  ///< of these pixels to the stack's
};

/// Returns what is off in a run, the gravest first. A series that is given wrongly as a whole
/// (contrast, order, alignment) has no warning about its thickness, because that cannot be judged
/// then. docs/verdict.md has the measurements that the limits rest on.
std::vector<Warning> find_warnings(const Verdict& verdict, const GivenInput& input);

}  // namespace tomofield::reconstruction
