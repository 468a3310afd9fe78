#pragma once

#include <string>

#include "field/model_file.h"
#include "reconstruct/fit.h"

namespace tomofield::reconstruct {

/// The state of a fit between two steps as the model file stores it. With
/// `with_moments` it can be continued bit for bit; a finished fit leaves the
/// optimiser's moments out, which triples the file.
field::TrainingState save_state(const Fit& fit, const std::string& fingerprint, bool with_moments);

/// Puts a stored field and state into a fresh fit of the same options. Throws
/// Error naming `path` if they belong to another series or other options, and
/// what differs. A fingerprint is a JSON text.
void restore_state(const std::string& path, const std::string& fingerprint,
                   const field::Field& stored, const field::TrainingState& state, Fit& fit);

}  // namespace tomofield::reconstruct
