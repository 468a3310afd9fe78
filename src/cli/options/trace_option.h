#pragma once

#include <CLI/CLI.hpp>
#include <filesystem>
#include <functional>
#include <optional>

#include "distributed/communicator.h"

namespace tomofield::cli {

/// Registers --trace, which --help-all shows.
void add_trace_option(CLI::App& command, std::optional<std::filesystem::path>& file);

/// Calls run(). If there is a `file`, the first process records what it did (base/trace.h) and
/// writes the record, also if run() throws.
void run_traced(const std::optional<std::filesystem::path>& file,
                const distributed::Communicator& processes, const std::function<void()>& run);

}  // namespace tomofield::cli
