#pragma once

#include <filesystem>
#include <nlohmann/json_fwd.hpp>
#include <optional>

#include "distributed/communicator.h"
#include "options/run_options.h"
#include "reconstruct/results.h"
#include "reconstruct/run.h"
#include "tilt_series/tilt_series.h"

namespace tomofield::reconstruction {

/// The end of a run. A run that writes files can be resumed after a stop.
enum class Outcome {
  kFinished,
  kStopped,        ///< during the fit; the checkpoint is saved
  kStoppedTuning,  ///< during the trials; those of --tune that are finished are stored
};

/// The results of a run.
struct RunResult {
  Outcome outcome = Outcome::kFinished;
  std::optional<Results> results = {};    ///< of a finished run
  std::filesystem::path checkpoint = {};  ///< of a run that was stopped during the fit
};

/// Does the main job: prepares the views, chooses settings by trials if the options ask for it,
/// fits a field and samples it. Writes the volume (MRC), the model (HDF5, which is also the
/// checkpoint during the run), and the metrics with the resolved options (JSON). If Options::output
/// is empty, it writes no file. With halves it makes three fits (halves.h). Throws Error for bad
/// input. The caller has called claim_outputs() and plan_run() before.
///
/// If several processes call it, they share the work. The results have the same bits as those of
/// one process. The root writes the files.
RunResult reconstruct(
    const tilt_series::TiltSeries& series, const options::ReconstructOptions& options,
    const ReconstructHooks& hooks,
    const distributed::Communicator& processes = distributed::Communicator::alone());

/// Prepares the views, makes the trials of a run, and ends there: no field is fitted to all views.
/// Returns the choice and the trials as tuning_json() writes them, and null if the options leave
/// nothing to trials. Returns nothing if a stop was requested. Throws Error and shares work as
/// reconstruct() does, and the caller has called the same functions before.
std::optional<nlohmann::json> choose_settings_alone(
    const tilt_series::TiltSeries& series, const options::ReconstructOptions& options,
    const ReconstructHooks& hooks,
    const distributed::Communicator& processes = distributed::Communicator::alone());

}  // namespace tomofield::reconstruction
