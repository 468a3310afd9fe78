#pragma once

#include <nlohmann/json.hpp>

#include "measurement/prepare.h"

namespace tomofield::output {

/// Returns the metrics of the masks as JSON, for every command that reconstructs: beads, hot and
/// dead pixels, and the fraction of rays without a loss, of all rays and by view. Views are in the
/// stack's order.
nlohmann::json mask_json(const measurement::Measurement& series);

}  // namespace tomofield::output
