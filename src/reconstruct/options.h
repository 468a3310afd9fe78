#pragma once

#include <filesystem>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "fit/options.h"
#include "measurement/prepare.h"
#include "output/volume.h"
#include "tilt_series/tilt_series.h"

namespace tomofield::reconstruction {

/// Everything that a reconstruction is made from.
struct ReconstructOptions {
  tilt_series::TiltSeriesOptions input;
  measurement::SpecimenOptions specimen;
  fit::FieldOptions field;
  fit::FitOptions fit;
  bool choose_penalty = false;  ///< of total variation, by held-out error, in place of fit.penalty
  bool tune = false;  ///< choose the weight, rank and epochs by held-out error too (tune.h)
  output::VolumeOptions volume;
  std::filesystem::path output;  ///< the volume; model, JSON and pictures lie beside it;
                                 ///< empty: results stay in memory
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

/// Throws Error for faulty options, and if results would replace an input, would
/// replace existing files without --overwrite or --resume, or cannot be written
/// where they shall go. Nothing is read.
void check_options(const ReconstructOptions& options);

/// Every option as it was resolved, for the JSON and the model file.
nlohmann::json options_json(const ReconstructOptions& options);

}  // namespace tomofield::reconstruction
