#pragma once

#include <array>
#include <optional>

#include "reconstruct/results.h"
#include "reconstruct/run.h"
#include "tilt_series/tilt_series.h"
#include "tune/tuning.h"

namespace tomofield::reconstruction {

/// The fits of all data and of both halves after their last step.
struct FinishedFits {
  record::FitRecord whole;
  std::optional<measurement::PredictedView> held_out_view;  ///< as the fit of all data predicts it
  std::array<record::FitRecord, 2> halves;                  ///< [tilt_series::Half]
};

/// Writes the results of three finished fits, whose models are in their files: the volume of all
/// data and those of both halves, the shell correlation of the halves with its plot, the local
/// resolution, the uncertainty, linear halves if the options ask for them, and the metrics. All of
/// them appear together (io::OutputSet). If one cannot be written, none appears; the models stay,
/// and Error is thrown. Every process calls it; the root writes.
RunResult write_half_results(const Run& run, const FinishedFits& fits,
                             const std::optional<tune::TunedFit>& tuned);

}  // namespace tomofield::reconstruction
