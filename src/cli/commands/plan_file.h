#pragma once

#include <CLI/CLI.hpp>
#include <filesystem>
#include <optional>

#include "distributed/communicator.h"
#include "options/run_options.h"
#include "plan/plan.h"
#include "plan/run_estimate.h"

namespace tomofield::cli {

/// Registers --plan.
void add_plan_option(CLI::App& command, std::optional<std::filesystem::path>& file);

/// Writes what a run needs as JSON, whether this machine has it or not, for programs that start
/// runs elsewhere or later (batch).
void write_plan(const std::filesystem::path& file, const options::ReconstructOptions& options,
                const distributed::Communicator& processes);

/// Prints the time and the disk that a run takes. `num_processes` share the time.
void print_estimate(const plan::RunEstimate& estimate, int num_processes);

}  // namespace tomofield::cli
