#pragma once

#include <nlohmann/json.hpp>

#include "measurement/prepare.h"
#include "tilt_series/tilt_series.h"

namespace tomofield::reconstruction {

/// What every command that reconstructs records of its options.
nlohmann::json input_json(const tilt_series::TiltSeriesOptions& options);
nlohmann::json specimen_json(const measurement::SpecimenOptions& options);

}  // namespace tomofield::reconstruction
