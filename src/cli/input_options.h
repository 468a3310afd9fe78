#pragma once

#include <CLI/CLI.hpp>

#include "tilt_series/tilt_series.h"

namespace tomofield::cli {

/// Registers every option that says how a tilt series is read. `options` must outlive the parsing.
void add_series_options(CLI::App& command, tilt_series::TiltSeriesOptions& options);

/// The same, and the positional stack that it is read from.
void add_input_options(CLI::App& command, tilt_series::TiltSeriesOptions& options);

}  // namespace tomofield::cli
