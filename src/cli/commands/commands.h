#pragma once

#include <CLI/CLI.hpp>

#include "distributed/communicator.h"

namespace tomofield::cli {

// Each function adds one subcommand to the program; the subcommand's callback does the work and
// throws tomofield::Error for the user's mistakes. One file each: src/cli/commands/NAME_command.cc.

void add_align_command(CLI::App& program);
void add_baseline_command(CLI::App& program);
void add_batch_command(CLI::App& program);
void add_compare_command(CLI::App& program);
void add_evaluate_command(CLI::App& program);
void add_export_command(CLI::App& program);
void add_info_command(CLI::App& program);
/// The only one that several processes may share.
void add_reconstruct_command(CLI::App& program, const distributed::Communicator& processes);
void add_simulate_command(CLI::App& program);
void add_view_command(CLI::App& program);

}  // namespace tomofield::cli
