#pragma once

#include "compact/leaf_code.h"
#include "compact/truncation.h"

namespace tomofield::compact {

/// Rounds modes to whole numbers of steps. Components that become zero are left out, so the ranks
/// may fall.
QuantisedLeaf quantise(const Truncation& modes, int nx, int ny, int nz, double step);

/// Returns the modes that the parameters stand for.
Truncation dequantised_modes(const QuantisedLeaf& leaf, double step);

}  // namespace tomofield::compact
