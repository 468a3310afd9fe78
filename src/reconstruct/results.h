#pragma once

#include <filesystem>
#include <functional>
#include <nlohmann/json.hpp>
#include <optional>

#include "fit/fit.h"
#include "measurement/prepare.h"
#include "output/model_file.h"
#include "reconstruct/options.h"
#include "reconstruct/run_record.h"
#include "reconstruct/verdict.h"

namespace tomofield::reconstruction {

/// Returns the metadata of a fitted model: geometry, region, units, contrast and options.
output::ModelInfo model_info(const measurement::Measurement& series,
                             const ReconstructOptions& options);

/// Says what a finished fit tells of itself.
struct Findings {
  nlohmann::json metrics;
  Verdict verdict;
  std::optional<measurement::ViewErrors> held_out;
};

/// Measures what a finished fit tells. Every process calls it.
Findings examine(const fit::Fit& fit, const measurement::Measurement& series,
                 const ReconstructOptions& options, const RunRecord& record);

/// Holds the results of a run.
struct Results {
  /// The model; each process has the parameters of its own leaves. Halves have none: theirs are in
  /// files.
  std::optional<output::Model> model;
  nlohmann::json metrics;  ///< the content of the JSON file beside the volume
  Verdict verdict;
  tilt_series::BeadMasking bead_masking = tilt_series::BeadMasking::kNone;
};

/// Writes more results of a run, whose volume is in the file `volume`.
using WriteMore = std::function<void(const Results& results, const std::filesystem::path& volume)>;

/// Takes the results out of a finished fit, which loses its field. If options.resolved.output names
/// the volume, it writes the volume, the model, the metrics, and a picture of a held-out view if
/// there is one; then the root calls `write_more`, if there is one. All these files appear together
/// (io::OutputSet). If one cannot be written, the model alone appears, because it is the checkpoint
/// of the finished fit, and Error is thrown. Every process calls it.
Results finish(fit::Fit& fit, const measurement::Measurement& series,
               const ReconstructOptions& options, const RunRecord& record,
               const WriteMore& write_more);

}  // namespace tomofield::reconstruction
