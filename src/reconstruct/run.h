#pragma once

#include "distributed/communicator.h"
#include "measurement/measurement.h"
#include "reconstruct/options.h"
#include "reconstruct/reconstruct.h"

namespace tomofield::reconstruction {

/// What the steps of a run share.
struct Run {
  const ReconstructHooks& hooks;
  const distributed::Communicator& processes;
  ReconstructOptions options;
  OutputPaths paths;
  measurement::Measurement measurement;  ///< of all views

  bool writes_files() const { return !options.resolved.output.empty(); }
};

}  // namespace tomofield::reconstruction
