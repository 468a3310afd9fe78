#pragma once

#include "distributed/communicator.h"

namespace tomofield::cli {

/// Parses the command line and runs the subcommand. Returns the exit status: 0 for success, 2 for a
/// fault of the input or the system (tomofield::Error), 1 for a fault of the program. All processes
/// of a job return the same status. A fault in one process alone ends all of them with its status.
int run_program(int argc, char** argv, const distributed::Session& session);

}  // namespace tomofield::cli
