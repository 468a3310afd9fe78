#pragma once

#include <CLI/CLI.hpp>
#include <filesystem>
#include <optional>

#include "distributed/communicator.h"
#include "options/run_options.h"

namespace tomofield::cli {

/// Registers --choice. `--plan` is registered already.
void add_choice_option(CLI::App& command, std::optional<std::filesystem::path>& file);

/// Makes the trials of a run alone, and writes as JSON what they choose (null if nothing is left to
/// trials), for programs that give one choice to several runs (batch). Throws ExitStatus if it was
/// stopped.
void write_choice(const std::filesystem::path& file, const options::ReconstructOptions& options,
                  const distributed::Communicator& processes);

}  // namespace tomofield::cli
