#pragma once

#include <nlohmann/json.hpp>

#include "measurement/prepare.h"

namespace tomofield::output {

/// What was masked, for the figures of every command that reconstructs: beads,
/// hot and dead pixels, and the part of all rays and of each view's that
/// carries no loss, views in the stack's order.
nlohmann::json mask_json(const measurement::PreparedSeries& series);

}  // namespace tomofield::output
