#pragma once

#include <optional>

#include "reconstruct/reconstruct.h"
#include "reconstruct/run.h"
#include "tilt_series/tilt_series.h"
#include "tune/tuning.h"

namespace tomofield::reconstruction {

/// Reconstructs all data, and then both halves of the frames or of the tilts (docs/halves.md):
/// three fits, one after the other, that share geometry, masks, noise, penalty and weights. The
/// first is the fit of a run without halves. The halves keep the models of the views that it found.
/// Each fit has a model file, which is its checkpoint. Then half_results.h writes the volumes and
/// what they tell. `run` has its settings chosen, by `tuned` if there were trials. Every process
/// calls it.
RunResult reconstruct_halves(const tilt_series::TiltSeries& series, const Run& run,
                             const RunRecord& record, const std::optional<tune::TunedFit>& tuned);

}  // namespace tomofield::reconstruction
