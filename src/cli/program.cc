#include "cli/program.h"

#include <fmt/core.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <filesystem>
#include <new>
#include <string>
#include <string_view>
#include <vector>

#include "base/log.h"
#include "cli/commands.h"
#include "cli/config_file.h"
#include "cli/exit_status.h"
#include "tomofield/error.h"

namespace tomofield::cli {
namespace {

void print_log(base::LogLevel level, std::string_view message) {
  fmt::print(stderr, "{}{}\n", level == base::LogLevel::kWarning ? "warning: " : "", message);
}

void add_commands(CLI::App& program) {
  add_reconstruct_command(program);
  add_baseline_command(program);
  add_export_command(program);
  add_evaluate_command(program);
  add_compare_command(program);
  add_simulate_command(program);
  add_info_command(program);
}

// The subcommand that was called, as the user writes it.
std::string command_name(const CLI::App& program) {
  std::string name = program.get_name();
  for (const CLI::App* app = &program; !app->get_subcommands().empty();) {
    app = app->get_subcommands().front();
    name += " " + app->get_name();
  }
  return name;
}

// CLI11 would say that a command is missing where it is misspelt.
void require_known_command(const CLI::App& program, const std::vector<std::string>& arguments) {
  const CLI::App* app = &program;
  for (const std::string& word : arguments) {
    if (app->get_require_subcommand_min() == 0 || word.rfind('-', 0) == 0) return;
    const auto named =
        app->get_subcommands([&](const CLI::App* sub) { return sub->get_name() == word; });
    if (named.empty())
      throw Error(fmt::format("there is no command '{}': `tomofield --help` lists them", word));
    app = named.front();
  }
}

}  // namespace

int run_program(int argc, char** argv) {
  CLI::App program{
      "tomofield: clean tomograms from aligned tilt series by continuous density fields",
      "tomofield"};
  program.set_version_flag("--version", "tomofield " TOMOFIELD_VERSION);
  program.require_subcommand(1);
  base::set_log_sink(print_log);
  add_commands(program);
  try {
    std::vector<std::string> arguments(argv + 1, argv + argc);
    require_known_command(program, arguments);
    expand_config_file(program, arguments);
    std::reverse(arguments.begin(), arguments.end());  // CLI11 takes them last first
    program.parse(arguments);
    return 0;
  } catch (const CLI::ParseError& error) {
    if (error.get_exit_code() == 0) return program.exit(error);  // --help, --version
    fmt::print(stderr, "tomofield: {}; `{} --help` lists the options\n", error.what(),
               command_name(program));
    return 2;
  } catch (const Error& error) {
    fmt::print(stderr, "tomofield: {}\n", error.what());
    return 2;
  } catch (const ExitStatus& exit) {
    fmt::print(stderr, "tomofield: {}\n", exit.what());
    return exit.status();
  } catch (const std::bad_alloc&) {
    fmt::print(stderr,
               "tomofield: the system has no more memory to give: end other programs, or reduce "
               "the problem (a larger --bin, a smaller --roi or --thickness, fewer --threads)\n");
    return 2;
  } catch (const std::filesystem::filesystem_error& error) {
    fmt::print(stderr, "tomofield: '{}' cannot be used: {}\n", error.path1().string(),
               error.code().message());
    return 2;
  } catch (const std::exception& error) {
    fmt::print(stderr, "tomofield: internal error, please report it: {}\n", error.what());
    return 1;
  }
}

}  // namespace tomofield::cli
