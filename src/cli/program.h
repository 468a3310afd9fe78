#pragma once

#include "distributed/communicator.h"

namespace tomofield::cli {

/// Parses the command line and runs the subcommand. Returns the exit status:
/// 0 success, 2 a fault of the input or the system (tomofield::Error), 1 a
/// fault of the program. Of a job of several processes, all return the same, or a fault that
/// one has by itself ends them all with its status.
int run_program(int argc, char** argv, const distributed::Session& session);

}  // namespace tomofield::cli
