#pragma once

#include <CLI/CLI.hpp>

#include "tilt_series/tilt_series.h"

namespace tomofield::cli {

/// Registers the positional stack and every option that says what the tilt
/// series is and how it is read. `options` must outlive the parsing.
void add_input_options(CLI::App& command, tilt_series::TiltSeriesOptions& options);

}  // namespace tomofield::cli
