#pragma once

#include <filesystem>
#include <span>

#include "simulate/simulate_series.h"
#include "simulate/simulation.h"

namespace tomofield::simulate {

/// Writes the record beside a simulated series: the options, the views, and every body, with
/// doubles that read back exactly. Positions and lengths are in voxels relative to the volume's
/// centre, (X, Y, Z).
void write_phantom_record(const std::filesystem::path& file, const SimulationOptions& options,
                          const Phantom& phantom, std::span<const SimulatedView> views,
                          const SimulationSummary& summary);

}  // namespace tomofield::simulate
