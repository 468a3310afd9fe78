#pragma once

#include <nlohmann/json.hpp>
#include <span>

#include "simulate/phantom.h"
#include "simulate/simulate_series.h"
#include "simulate/simulation.h"

namespace tomofield::simulate {

/// The record beside a simulated series, as JSON: what was asked for, what
/// every view went through, and every ellipsoid, with doubles that read back
/// exactly. Positions and lengths in voxels about the volume's centre, (X, Y, Z).
nlohmann::json phantom_json(const SimulationOptions& options, const Phantom& phantom,
                            std::span<const SimulatedView> views, const SimulationSummary& summary);

}  // namespace tomofield::simulate
