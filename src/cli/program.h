#pragma once

namespace tomofield::cli {

/// Parses the command line and runs the subcommand. Returns the exit status:
/// 0 success, 2 a fault of the input or the system (tomofield::Error), 1 a
/// fault of the program.
int run_program(int argc, char** argv);

}  // namespace tomofield::cli
