#pragma once

#include <CLI/CLI.hpp>
#include <filesystem>
#include <optional>

#include "distributed/communicator.h"
#include "options/run_options.h"

namespace tomofield::cli {

/// Registers --choice. `--plan` is registered already.
void add_choice_option(CLI::App& command, std::optional<std::filesystem::path>& file);

/// Registers --batch-choice, which names the file of the choice that a batch gives its runs.
void add_batch_choice_option(CLI::App& command, std::optional<std::filesystem::path>& file);

/// Notes that those options of a parsed command that the choice of a batch sets come from its file.
void note_choice_of_batch(const CLI::App& command, const std::filesystem::path& file,
                          option_table::Choices& choices);

/// Makes the trials of a run alone, and writes as JSON what they choose (null if nothing is left to
/// trials), for programs that give one choice to several runs (batch). Throws ExitStatus if it was
/// stopped.
void write_choice(const std::filesystem::path& file, const options::ReconstructOptions& options,
                  const distributed::Communicator& processes);

}  // namespace tomofield::cli
