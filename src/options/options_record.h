#pragma once

#include <nlohmann/json.hpp>
#include <string>

#include "options/run_options.h"

namespace tomofield::options {

/// Returns the resolved options and the constants of the method, for the metrics and the model
/// file. It says nothing of where the results are.
nlohmann::json options_json(const ReconstructOptions& options);
std::string options_text(const ReconstructOptions& options);

}  // namespace tomofield::options
