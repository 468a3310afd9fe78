#pragma once

#include <CLI/CLI.hpp>

#include "measurement/prepare.h"

namespace tomofield::cli {

/// Registers --thickness, --roi, --hand, --center and --no-margin: what every
/// command that reconstructs has to know of the specimen.
void add_specimen_options(CLI::App& command, measurement::SpecimenOptions& options);
/// The same without --thickness: where a volume that there is lies in the views.
void add_place_options(CLI::App& command, measurement::SpecimenOptions& options);

}  // namespace tomofield::cli
