#pragma once

#include <CLI/CLI.hpp>
#include <filesystem>
#include <functional>
#include <optional>
#include <vector>

#include "distributed/communicator.h"
#include "tomofield/options.h"

namespace tomofield::cli {

/// Registers --trace, which --help-all shows.
void add_trace_option(CLI::App& command, std::optional<std::filesystem::path>& file);

/// Checks before any work that the trace can be written, if there is to be one. Throws Error if it
/// would be one of the run's `results` or replace a file of the series, if it cannot be written at
/// its place, or, unless `may_replace`, if it exists.
void check_trace_file(const std::optional<std::filesystem::path>& file,
                      std::vector<std::filesystem::path> results, const SeriesFiles& input,
                      bool may_replace);

/// Calls run(). If there is a `file`, the first process records what it did (base/trace.h) and
/// writes the record, also if run() throws.
void run_traced(const std::optional<std::filesystem::path>& file,
                const distributed::Communicator& processes, const std::function<void()>& run);

}  // namespace tomofield::cli
