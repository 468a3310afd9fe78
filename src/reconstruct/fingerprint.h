#pragma once

#include <string>

#include "distributed/communicator.h"
#include "measurement/prepare.h"
#include "reconstruct/options.h"

namespace tomofield::reconstruction {

/// What decides the bits of a fit: the options, the geometry and the rays themselves (JSON). The
/// same on all processes that share the rays.
std::string fingerprint_of(const ReconstructOptions& options,
                           const measurement::Measurement& series,
                           const distributed::Communicator& processes);

}  // namespace tomofield::reconstruction
