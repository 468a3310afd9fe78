#pragma once

#include <optional>
#include <vector>

#include "measurement/halves.h"
#include "reconstruct/results.h"
#include "reconstruct/run.h"
#include "tune/tuning.h"

namespace tomofield::reconstruction {

inline const char* name_of(tilt_series::Half half) {
  return half == tilt_series::Half::kEven ? "even" : "odd";
}

/// Returns one half of the frames or of the tilts, as the options say. Every process calls it.
measurement::Measurement half_measurement(tilt_series::Half half, const Run& run);

/// Turns the models of the views of the series into those of a half.
std::vector<measurement::ViewModel> views_of_half(const std::vector<measurement::ViewModel>& views,
                                                  const Run& run);

/// Reconstructs all data, and then both halves of the frames or of the tilts (docs/halves.md):
/// three fits, one after the other, that share geometry, masks, noise, penalty and weights. The
/// first is the fit of a run without halves. The halves keep the models of the views that it found.
/// Each fit has a model file, which is its checkpoint. Then half_results.h writes the volumes and
/// what they tell. `run` has its settings chosen, by `tuned` if there were trials. Every process
/// calls it.
RunResult reconstruct_halves(const Run& run, const std::optional<tune::TunedFit>& tuned);

}  // namespace tomofield::reconstruction
