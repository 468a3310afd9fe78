#pragma once

#include <CLI/CLI.hpp>

#include "output/volume.h"

namespace tomofield::cli {

/// Registers --mode, --axes and --invert: how a volume is written.
void add_volume_options(CLI::App& command, output::VolumeOptions& options);

}  // namespace tomofield::cli
