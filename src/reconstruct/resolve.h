#pragma once

#include "reconstruct/options.h"
#include "tomofield/options.h"

namespace tomofield::reconstruction {

/// Fills in the options that are to be chosen from other options. The penalty and its weight stay
/// empty if neither is given: trials choose them.
Options resolve(const Options& requested);

/// Resolves the options and hands them to the rooms below.
ReconstructOptions run_options(const SeriesFiles& files, const Options& requested);

}  // namespace tomofield::reconstruction
