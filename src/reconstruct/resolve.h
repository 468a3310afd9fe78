#pragma once

#include "reconstruct/options.h"
#include "tomofield/options.h"

namespace tomofield::reconstruction {

/// Returns what a reconstruction is made from, with the defaults of everything that the options
/// leave open.
ReconstructOptions resolve(const SeriesFiles& files, const Options& options);

}  // namespace tomofield::reconstruction
