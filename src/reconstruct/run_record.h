#pragma once

#include <vector>

#include "geometry/raw_from_aligned.h"
#include "reconstruct/checkpoint.h"

namespace tomofield::reconstruction {

/// What a run knows beside its fit.
struct RunRecord {
  FitOrigin origin;
  /// Where the pixels of each aligned view come from in the stack.
  std::vector<geometry::RawFromAligned> alignment;
  double fit_seconds = 0.0;
};

}  // namespace tomofield::reconstruction
