#pragma once

#include <array>
#include <optional>

#include "reconstruct/results.h"
#include "reconstruct/run.h"
#include "reconstruct/tuning.h"
#include "tilt_series/tilt_series.h"

namespace tomofield::reconstruction {

/// Holds the findings of the fits of both halves, [tilt_series::Half].
using FinishedHalves = std::array<Findings, 2>;

/// Writes the results of two finished fits, whose models are in their files: the volumes of both
/// halves and their mean, their shell correlation with its plot, the local resolution, the
/// uncertainty of the mean, linear halves if the options ask for them, and the metrics. All of them
/// appear together (io::OutputSet). If one cannot be written, none appears; the models stay, and
/// Error is thrown. Every process calls it; the root writes.
Results write_half_results(const tilt_series::TiltSeries& series, const Run& run,
                           const FinishedHalves& halves, const std::optional<TunedFit>& tuned);

}  // namespace tomofield::reconstruction
