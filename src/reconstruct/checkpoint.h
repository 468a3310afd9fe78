#pragma once

#include <filesystem>
#include <optional>
#include <string>

#include "fit/fit.h"
#include "output/model_file.h"
#include "reconstruct/tuning.h"

namespace tomofield::reconstruction {

/// What a fit was made from.
struct FitOrigin {
  std::string fingerprint;        ///< of the series and the options (JSON)
  std::optional<TunedFit> tuned;  ///< by which some of the options were chosen
};

/// How far a fit is, as the model file stores it: all that a finished fit leaves.
output::TrainingState progress_state(const fit::Fit& fit, const FitOrigin& origin);

/// Writes the model of a fit with what progress_state() gave: parameters from wherever they are,
/// by the first of the processes that share it.
void save_fit(const std::filesystem::path& path, const fit::Fit& fit, const output::ModelInfo& info,
              const output::TrainingState& state);

/// Writes the model of a fit between two steps with its optimiser's state, which
/// triples the file, so that it can be continued bit for bit, by any number of processes.
void save_checkpoint(const std::filesystem::path& path, const fit::Fit& fit,
                     const output::ModelInfo& info, const FitOrigin& origin);

/// What the options of the fit in a checkpoint or model were chosen by. Throws Error if `path` is
/// none.
std::optional<TunedFit> stored_choice(const std::filesystem::path& path);

/// Puts a stored field and state into a fresh fit of the same options, on each process what it
/// needs. Throws Error naming `path` if they belong to another series or other options, and what
/// differs.
void restore_fit(const std::filesystem::path& path, const std::string& fingerprint, fit::Fit& fit);

}  // namespace tomofield::reconstruction
