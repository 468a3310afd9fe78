#pragma once

#include <string>

#include "distributed/communicator.h"
#include "reconstruct/prepare.h"
#include "reconstruct/run_options.h"

namespace tomofield::reconstruct {

/// What decides the bits of a fit: the options, the geometry and the rays themselves (JSON). The
/// same on all processes that share the rays.
std::string fingerprint_of(const ReconstructOptions& options, const PreparedSeries& series,
                           const distributed::Communicator& processes);

}  // namespace tomofield::reconstruct
