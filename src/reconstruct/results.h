#pragma once

#include <filesystem>
#include <nlohmann/json.hpp>
#include <optional>

#include "checkpoint/checkpoint.h"
#include "fit/fit.h"
#include "io/saving/output_set.h"
#include "measurement/prepare.h"
#include "options/run_options.h"
#include "output/model_file.h"
#include "output/volume.h"
#include "reconstruct/run.h"
#include "verdict/verdict.h"

namespace tomofield::reconstruction {

/// What a finished fit tells of itself.
struct Findings {
  nlohmann::json metrics;
  verdict::Verdict verdict;
  std::optional<measurement::ViewErrors> held_out;
};

/// Measures what a finished fit tells. Every process calls it.
Findings examine(const fit::Fit& fit, const measurement::Measurement& series,
                 const options::ReconstructOptions& options, const RunRecord& record);

/// The results of a run.
struct Results {
  /// The model; each process has the parameters of its own leaves. A run with halves has none: its
  /// models are in files.
  std::optional<output::Model> model;
  nlohmann::json metrics;  ///< the content of the JSON file beside the volume
  verdict::Verdict verdict;
  tilt_series::BeadMasking bead_masking = tilt_series::BeadMasking::kNone;
};

/// Predicts the held-out view nearest to zero tilt, if views are held out.
std::optional<measurement::PredictedView> central_held_out_view(
    const fit::Fit& fit, const measurement::Measurement& series, const Findings& found);

/// Returns the content of the JSON file of a run.
nlohmann::json run_json(const options::ReconstructOptions& options, nlohmann::json metrics);

/// What the files of a run are written from, beside its results.
struct ResultFiles {
  const options::ReconstructOptions& options;
  const checkpoint::FitOrigin& origin;
  const output::TrainingState& state;  ///< of the fit, for a model that can be continued
  const output::VolumeShare& share;
  const std::optional<measurement::PredictedView>& held_out_view;
  const WriteMore& write_more;
};

/// Writes the volume, the model, the metrics and pictures of a run; then the root calls
/// `write_more`, if there is one. All files appear together. If one cannot be written, the model
/// alone appears, and Error is thrown. Every process calls it.
void write_together(const ResultFiles& files, io::OutputSet& outputs, Results& results);

/// Takes the results out of a finished fit, which loses its field. If options.resolved.output names
/// the volume, it writes the files (write_together()); the model is the checkpoint of the finished
/// fit. Every process calls it.
Results finish(fit::Fit& fit, const measurement::Measurement& series,
               const options::ReconstructOptions& options, const RunRecord& record,
               const WriteMore& write_more);

}  // namespace tomofield::reconstruction
