#pragma once

#include "io/output_set.h"
#include "reconstruct/options.h"

namespace tomofield::reconstruction {

/// Lets `results` remove what an earlier run of the same name has left and this run does not write,
/// such as the halves or the picture of trials: it would contradict the new tomogram. Only a run
/// with --overwrite does so. Inputs stay, and so do alignments (NAME_align.*), which are of use
/// without the tomogram and which `tomofield align` writes too. Logs the names. All new files must
/// be in the set.
void remove_stale_files(const ReconstructOptions& options, io::OutputSet& results);

}  // namespace tomofield::reconstruction
