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

/// Everything that a reconstruction is made from. run_options() in resolve.h makes it.
struct ReconstructOptions {
  SeriesFiles files;
  Options resolved;             ///< every option as it is used
  bool choose_penalty = false;  ///< by trials; `resolved` has the penalty that they start from
  // The same options as the rooms below take them, with the constants of the method.
  tilt_series::TiltSeriesOptions input;
  measurement::SpecimenOptions specimen;
  fit::FieldOptions field;
  fit::FitOptions fit;
  output::VolumeOptions volume;
  /// Returns how many trials come before the fit, about; 0: nothing is to be chosen. A fit of few
  /// views cannot spare any for the penalty alone, and rays of raw views are not predicted.
  int num_trials(int num_fitted_views) const;
  /// Returns a sentence for every option that is out of range or does not go with another one.
  std::vector<std::string> faults() const;
  /// Returns a sentence for every option that a job of several processes cannot have.
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

/// Returns every option as it was resolved and the constants of the method, for the JSON and the
/// model file.
nlohmann::json options_json(const ReconstructOptions& options);

}  // namespace tomofield::reconstruction
