#pragma once

#include "reconstruct/options.h"
#include "tomofield/options.h"

namespace tomofield::reconstruction {

/// Fills in the options that are to be chosen from other options: leaves, epochs, learning rate,
/// weights, activation and the scale of views. The penalty and its weight stay empty if neither is
/// given: trials choose them. Values out of range are left as they are; check_options() names them.
Options resolve(const Options& requested);

/// Resolves the options and hands them to the rooms below. Where trials will choose, the values are
/// those that the trials start from, and a fit keeps them if it can spare no views for trials.
ReconstructOptions run_options(const SeriesFiles& files, const Options& requested);

}  // namespace tomofield::reconstruction
