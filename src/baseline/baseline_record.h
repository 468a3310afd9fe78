#pragma once

#include <nlohmann/json.hpp>
#include <optional>
#include <string>

#include "baseline/run_baseline.h"
#include "baseline/tune.h"
#include "measurement/held_out.h"
#include "measurement/measurement.h"

namespace tomofield::baseline {

/// Refers to all that is recorded of a finished run.
struct BaselineRecord {
  const BaselineOptions& options;  ///< with the method that trials chose
  const measurement::Measurement& series;
  const VoxelProblem& problem;
  const Solution& solution;
  std::size_t num_parameters;
  double seconds;                                          ///< of the solution
  const std::optional<Tuned>& tuned;                       ///< none without trials
  const std::optional<measurement::ViewErrors>& held_out;  ///< none if no views are held out
};

/// Returns the record of a run as the JSON file beside the volume has it.
std::string record_text(const BaselineRecord& record);

/// Returns the name and every option of a method.
nlohmann::json json_of(const Method& method);

/// Returns the settings that a tuning may change, as the command line writes them.
std::string settings_text(const Method& method);

/// Returns the options of a run as its files have them.
nlohmann::json options_json(const BaselineOptions& options);

}  // namespace tomofield::baseline
