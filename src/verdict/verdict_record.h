#pragma once

#include <nlohmann/json.hpp>

#include "verdict/verdict.h"

namespace tomofield::verdict {

/// Returns a verdict as the metrics of a run have it.
nlohmann::json verdict_json(const Verdict& verdict);

}  // namespace tomofield::verdict
