#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "checkpoint/checkpoint.h"
#include "fit/fit.h"
#include "io/saving/output_set.h"
#include "measurement/prepare.h"
#include "options/run_options.h"
#include "output/model_file.h"
#include "output/volume.h"
#include "reconstruct/run.h"
#include "record/run_record.h"

namespace tomofield::reconstruction {

/// The end of a run. A run that writes files can be resumed after a stop.
enum class Outcome {
  kFinished,
  kStopped,          ///< during the fit; the checkpoint is saved
  kStoppedTuning,    ///< during the trials; those of --tune that are finished are stored
  kStoppedAligning,  ///< during the alignment, of which nothing is kept
};

/// The result of a run. Only a finished run has more than its outcome.
struct RunResult {
  Outcome outcome = Outcome::kFinished;
  /// The model; each process has the parameters of its own leaves. A run with halves has none: its
  /// models are in files.
  std::optional<output::Model> model = {};
  record::RunRecord record = {};  ///< the content of the JSON file beside the volume
  std::vector<std::filesystem::path> pictures = {};  ///< that were drawn
  std::filesystem::path checkpoint = {};             ///< of a run that was stopped during the fit
  Options options = {};  ///< as they were used, with what trials have chosen
};

/// Examines a finished fit to `measured`. Every process calls it.
record::FitRecord examine(const fit::Fit& fit, const measurement::Measurement& measured,
                          const Run& run, const FitOutcome& outcome);

/// Predicts the held-out view nearest to zero tilt, if views are held out.
std::optional<measurement::PredictedView> central_held_out_view(
    const fit::Fit& fit, const measurement::Measurement& measured, const record::FitRecord& found);

/// Returns the record of a run whose fit of all data was examined.
record::RunRecord run_record(const options::ReconstructOptions& options, record::FitRecord fit);

/// What the files of a fit are written from, beside the result.
struct ResultFiles {
  const Run& run;
  const checkpoint::FitOrigin& origin;
  const output::TrainingState& state;  ///< of the fit, for a model that can be continued
  const output::VolumeShare& share;
  const std::optional<measurement::PredictedView>& held_out_view;
};

/// Throws the exception that is being handled, an Error, with advice at the end of its sentence.
[[noreturn]] void throw_with(const std::string& advice);

/// Writes the volume, the model, the metrics, pictures, files for other programs and the report of
/// a run. All files appear together. If one cannot be written, the model alone appears, and Error
/// is thrown. Every process calls it.
void write_together(const ResultFiles& files, io::OutputSet& outputs, RunResult& result);

/// Takes the result out of a finished fit to all views, which loses its field. If the run writes
/// files, it writes them (write_together()); the model is the checkpoint of the finished fit. Every
/// process calls it.
RunResult finish(fit::Fit& fit, const Run& run, const FitOutcome& outcome);

}  // namespace tomofield::reconstruction
