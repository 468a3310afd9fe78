#include "cli/program.h"

#include <fmt/core.h>

#include <CLI/CLI.hpp>

#include "cli/commands.h"
#include "tomofield/error.h"

namespace tomofield::cli {

int run_program(int argc, char** argv) {
  CLI::App program{"tomofield: clean tomograms from aligned tilt series by continuous density fields"};
  program.set_version_flag("--version", "tomofield " TOMOFIELD_VERSION);
  program.require_subcommand(1);
  add_evaluate_command(program);
  add_info_command(program);
  add_simulate_command(program);
  try {
    program.parse(argc, argv);
    return 0;
  } catch (const CLI::ParseError& error) {
    return program.exit(error) == 0 ? 0 : 2;
  } catch (const Error& error) {
    fmt::print(stderr, "tomofield: {}\n", error.what());
    return 2;
  } catch (const std::exception& error) {
    fmt::print(stderr, "tomofield: internal error, please report it: {}\n", error.what());
    return 1;
  }
}

}  // namespace tomofield::cli
