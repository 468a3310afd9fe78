#pragma once

#include "io/output_set.h"
#include "reconstruct/options.h"

namespace tomofield::reconstruction {

/// Lets `results` remove the pictures that an earlier run of the same name has drawn and this run
/// does not draw, such as that of its trials: they would contradict the new tomogram. Only a run
/// with --overwrite does so. Volumes, models and records stay: they may be another program's. Logs
/// the names. All new files must be in the set.
void remove_stale_files(const ReconstructOptions& options, io::OutputSet& results);

}  // namespace tomofield::reconstruction
