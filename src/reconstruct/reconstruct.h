#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <nlohmann/json.hpp>

#include "base/progress.h"
#include "distributed/communicator.h"
#include "reconstruct/options.h"
#include "reconstruct/prepare.h"
#include "reconstruct/write_volume.h"
#include "tilt_series/tilt_series.h"

namespace tomofield::reconstruct {

/// Everything that a reconstruction is made from.
struct ReconstructOptions {
  tilt_series::TiltSeriesOptions input;
  SpecimenOptions specimen;
  FieldOptions field;
  FitOptions fit;
  bool choose_penalty = false;  ///< of total variation, by held-out error, in place of fit.penalty
  bool tune = false;  ///< choose the weight, rank and epochs by held-out error too (tune.h)
  VolumeOptions volume;
  std::filesystem::path output;  ///< the volume; model, JSON and pictures lie beside it
  bool overwrite = false;
  bool resume = false;  ///< continue from the model file, if there is one
  double checkpoint_minutes = 5;
  /// Trials of settings before the fit, about; 0: none are to be chosen. A fit of few
  /// views cannot spare any for the penalty alone, and rays of raw views are not predicted.
  int num_trials(int num_fitted_views) const;
  /// Every fault that these options have by themselves, a sentence each.
  std::vector<std::string> faults() const;
  /// Those that they have for a job of several processes.
  std::vector<std::string> faults_of_job() const;
};

/// The files of a reconstruction, named after its volume.
struct OutputPaths {
  std::filesystem::path volume, model, json;
  std::filesystem::path tree_picture;  ///< of adaptive trees alone
  std::filesystem::path picture_prefix;
  std::filesystem::path held_out_picture;  ///< with views held out
  std::filesystem::path trials;            ///< of a tuning (JSON)
};
OutputPaths output_paths(const std::filesystem::path& volume);

/// What the caller sees while it runs.
struct ReconstructHooks {
  base::ProgressSink progress;
  base::ProgressSink tune_progress;  ///< of the trials before the fit
  std::function<bool()>
      stop_requested;  ///< asked after every step; true saves a checkpoint and stops
};

enum class Outcome { kFinished, kStopped, kStoppedTuning };

/// The main job: fits a field to the series and writes the volume (MRC), the
/// model (HDF5, also the checkpoint while it runs), and the figures and resolved
/// options (JSON). Call check_options() and
/// plan_run() first: this starts at once.
///
/// Processes share the work if all of them call it: the results have the same bits as those of
/// one, which the first puts in place.
Outcome reconstruct(
    const tilt_series::TiltSeries& tilt_series, const ReconstructOptions& options,
    const ReconstructHooks& hooks,
    const distributed::Communicator& processes = distributed::Communicator::alone());

/// What a run will do; nothing is allocated or written for it.
struct RunPlan {
  int num_views = 0;
  std::int64_t view_width = 0, view_height = 0;
  double pixel_size_A = 0;
  geometry::Roi roi;
  double thickness = 0;
  int num_leaves = 0;
  std::size_t num_parameters = 0;
  int num_trials = 0;  ///< short fits before it, about, that choose settings
  std::int64_t num_steps = 0;
  std::size_t memory_bytes = 0;  ///< estimated peak, of each process
};

/// Throws Error for options that do not fit the series or the number of processes, and when the
/// memory needed is beyond what the machine has.
RunPlan plan_run(const tilt_series::TiltSeries& series, const ReconstructOptions& options,
                 const distributed::Communicator& processes = distributed::Communicator::alone());

/// Throws Error for faulty options, and if results would replace an input, would
/// replace existing files without --overwrite or --resume, or cannot be written
/// where they shall go. Nothing is read.
void check_options(const ReconstructOptions& options);

/// Every option as it was resolved, for the JSON and the model file.
nlohmann::json options_json(const ReconstructOptions& options);

}  // namespace tomofield::reconstruct
