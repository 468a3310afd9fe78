#pragma once

#include <CLI/CLI.hpp>

#include "reconstruct/write_volume.h"

namespace tomofield::cli {

/// Registers --mode, --axes and --invert: how a volume is written.
void add_volume_options(CLI::App& command, reconstruct::VolumeOptions& options);

}  // namespace tomofield::cli
