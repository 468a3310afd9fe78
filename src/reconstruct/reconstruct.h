#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <nlohmann/json_fwd.hpp>
#include <optional>
#include <vector>

#include "base/progress.h"
#include "distributed/communicator.h"
#include "fit/stages.h"
#include "reconstruct/options.h"
#include "reconstruct/results.h"
#include "reconstruct/tiles.h"
#include "tilt_series/tilt_series.h"
#include "tomofield/options.h"

namespace tomofield::reconstruction {

/// The callbacks of a run.
struct ReconstructHooks {
  base::ProgressSink progress;       ///< receives the progress of the fit
  base::ProgressSink tune_progress;  ///< receives the progress of the trials before the fit
  /// Is asked after every step. If it returns true, the run saves a checkpoint and stops.
  std::function<bool()> stop_requested;
  /// Writes more results, which appear together with the others.
  WriteMore write_more = {};
};

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
    const tilt_series::TiltSeries& series, const ReconstructOptions& options,
    const ReconstructHooks& hooks,
    const distributed::Communicator& processes = distributed::Communicator::alone());

/// Prepares the views, makes the trials of a run, and ends there: no field is fitted to all views.
/// Returns the choice and the trials as tuning_json() writes them, and null if the options leave
/// nothing to trials. Returns nothing if a stop was requested. Throws Error and shares work as
/// reconstruct() does, and the caller has called the same functions before.
std::optional<nlohmann::json> choose_settings_alone(
    const tilt_series::TiltSeries& series, const ReconstructOptions& options,
    const ReconstructHooks& hooks,
    const distributed::Communicator& processes = distributed::Communicator::alone());

/// The plan of a run. Lengths are pixels of the binned views.
struct RunPlan {
  int num_views = 0;
  std::int64_t view_width = 0, view_height = 0;
  double pixel_size_A = 0;  ///< of the binned views
  Rectangle roi;
  double thickness = 0;
  int num_leaves = 0;              ///< at the start
  int most_vertices = 0;           ///< along an axis of a leaf
  std::size_t num_parameters = 0;  ///< max. during the last stage
  int num_trials = 0;              ///< expected number of short fits that choose settings
  std::vector<fit::Stage> stages;
  int steps_an_epoch = 0;
  std::int64_t num_steps = 0;    ///< of all stages of a fit
  int num_fits = 1;              ///< 3 with halves, one after the other
  TilePlan tiles;                ///< by which the region is fitted, if they are used
  std::size_t memory_bytes = 0;  ///< estimated peak of each process
};

/// Plans a run. It writes nothing and allocates neither views nor parameters. Throws Error for
/// options that do not fit the series or the number of processes.
RunPlan plan_run(const tilt_series::TiltSeries& series, const ReconstructOptions& options,
                 const distributed::Communicator& processes = distributed::Communicator::alone());

/// Throws Error if this machine has less memory than a run needs.
void require_memory(const RunPlan& plan, const distributed::Communicator& processes =
                                             distributed::Communicator::alone());

/// Returns plan_run(), and throws Error also as require_memory() and require_few_vertices() do.
RunPlan require_possible_run(
    const tilt_series::TiltSeries& series, const ReconstructOptions& options,
    const distributed::Communicator& processes = distributed::Communicator::alone());

/// Checks a run with --align before its views are aligned, which takes long: throws Error as
/// require_possible_run() does. Reads no view. Does nothing for a run without --align. Every
/// process calls it.
void check_before_alignment(
    const ReconstructOptions& options,
    const distributed::Communicator& processes = distributed::Communicator::alone());

/// Does the same for an alignment without a reconstruction: throws Error if there are too few views
/// or too little memory.
void check_alignment_alone(const ReconstructOptions& options);

/// Throws Error if a leaf would have more vertices along an axis than one can have.
void require_few_vertices(const RunPlan& plan);

}  // namespace tomofield::reconstruction
