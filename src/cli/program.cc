#include "cli/program.h"

#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <cstdio>
#include <filesystem>
#include <memory>
#include <new>
#include <sstream>
#include <string>
#include <string_view>
#include <vector>

#include "base/log.h"
#include "base/nearest_names.h"
#include "base/system/child_process.h"
#include "base/threads/parallel.h"
#include "base/version.h"
#include "cli/commands/commands.h"
#include "cli/commands/examples.h"
#include "cli/options/config_file.h"
#include "cli/options/help_formatter.h"
#include "cli/options/parse_fault.h"
#include "cli/terminal/console.h"
#include "io/tables/text_lines.h"
#include "tomofield/error.h"

namespace tomofield::cli {
namespace {

void print_log(base::LogLevel level, std::string_view message) {
  say("{}{}\n", level == base::LogLevel::kWarning ? "warning: " : "", message);
}

void add_commands(CLI::App& program, const distributed::Communicator& processes) {
  add_reconstruct_command(program, processes);
  add_align_command(program);
  add_baseline_command(program);
  add_export_command(program);
  add_view_command(program);
  add_evaluate_command(program);
  add_compare_command(program);
  add_batch_command(program);
  add_simulate_command(program);
  add_info_command(program);
}

// Returns the subcommand that was called.
const CLI::App& called_command(const CLI::App& program) {
  const CLI::App* app = &program;
  while (!app->get_subcommands().empty()) app = app->get_subcommands().front();
  return *app;
}

// Returns the name of a command as the user writes it: "tomofield baseline tv".
std::string command_name(const CLI::App& program) {
  std::string name = program.get_name();
  for (const CLI::App* app = &program; !app->get_subcommands().empty();) {
    app = app->get_subcommands().front();
    name += " " + app->get_name();
  }
  return name;
}

// Returns the commands that are most like a misspelt one, in brackets, or an empty text.
std::string suggestion(const CLI::App& program, const std::string& word) {
  std::vector<std::string> names;
  for (const CLI::App* command : program.get_subcommands(nullptr))
    names.push_back(command->get_name());
  return base::did_you_mean(base::nearest_names(word, names));
}

// Refuses a misspelt command. CLI11 would say that a command is missing.
void require_known_command(const CLI::App& program, const std::vector<std::string>& arguments) {
  const CLI::App* app = &program;
  std::string command = program.get_name();
  for (const std::string& word : arguments) {
    if (app->get_require_subcommand_min() == 0 || word.rfind('-', 0) == 0) return;
    const auto named =
        app->get_subcommands([&](const CLI::App* sub) { return sub->get_name() == word; });
    if (named.empty())
      throw Error(fmt::format("there is no {} '{}'{}: `{} --help` lists them",
                              app == &program ? "command" : "method", word, suggestion(*app, word),
                              command));
    command += " " + word;
    app = named.front();
  }
}

// Refuses a job of several processes for other commands, which would do all of their work in each.
void require_shared_command(const std::vector<std::string>& arguments,
                            const distributed::Communicator& processes) {
  if (processes.size() == 1 || arguments.empty() || arguments.front().rfind('-', 0) == 0 ||
      arguments.front() == "reconstruct")
    return;
  throw Error(
      fmt::format("{} processes were started, and only reconstruct shares its work: start "
                  "`tomofield {}` without mpirun or srun",
                  processes.size(), arguments.front()));
}

// Says whether what the command prints is its result. Other commands write files.
bool prints_its_result(const CLI::App& program) {
  const CLI::App& command = called_command(program);
  const CLI::Option* dry_run = command.get_option_no_throw("--dry-run");
  return &command == &program || command.get_name() == "info" || command.get_name() == "evaluate" ||
         command.get_name() == "view" || (dry_run != nullptr && dry_run->count() > 0);
}

// Says so if something that was printed is lost. That is a failure if it was the command's result.
// Returns the exit status.
int report_output(bool is_result) {
  const std::string fault = output_fault();
  if (fault.empty()) return 0;
  say("{} what was printed cannot be written: {}{}\n", is_result ? "tomofield:" : "warning:", fault,
      is_result ? "" : "; the files are whole");
  return is_result ? 1 : 0;
}

// Returns the bill of materials, which the build writes beside the program and `cmake --install`
// puts into share/tomofield.
std::string materials() {
  namespace fs = std::filesystem;
  const fs::path folder = base::program_path().parent_path();
  for (const char* place : {"materials.txt", "../share/tomofield/materials.txt"}) {
    if (fs::exists(folder / place)) return io::read_text_file(folder / place);
  }
  return fmt::format("The packages of this program are not known: '{}' is missing.",
                     (folder / "materials.txt").string());
}

void add_version_flag(CLI::App& program) {
  CLI::Option* verbose =
      program.add_flag("--verbose")
          ->description("List the packages of the program and their licences, too");
  const auto version = [verbose] {
    const std::string name =
        fmt::format("tomofield " TOMOFIELD_VERSION " ({})", base::source_commit());
    return verbose->count() == 0 ? name : name + "\n\n" + materials();
  };
  verbose->needs(program.set_version_flag("--version", version));
}

// Prints what --help or --version ask for.
void print_answer(const CLI::App& program, const CLI::ParseError& request) {
  std::ostringstream answer;
  program.exit(request, answer, answer);
  print_text(answer.str());
}

// Refuses "--option=" without a value, for which CLI11 would take the next word, and "-o=NAME", in
// which it would take the equals sign for a part of the name.
void require_values(const std::vector<std::string>& arguments) {
  for (const std::string& word : arguments) {
    if (word.starts_with("--") && word.find('=') == word.size() - 1)
      throw Error(fmt::format("{} has no value: give one, or leave the option out", word));
    if (word.starts_with("-o="))
      throw Error(fmt::format("'{}': -o takes its value after a space: give -o {}", word,
                              word.size() > 3 ? word.substr(3) : "NAME"));
  }
}

// Gives files behind "--" names that no option has: CLI11 takes a "--" after an option of several
// values for the end of these alone.
void name_files(std::vector<std::string>& arguments) {
  const auto marker = std::ranges::find(arguments, "--");
  for (auto word = marker; word != arguments.end(); ++word)
    if (word != marker) *word = base::file_word(*word);
}

// Parses the command line and runs the command. Returns the exit status, or throws.
int run_command(CLI::App& program, std::vector<std::string> arguments,
                const distributed::Communicator& processes) {
  if (arguments.empty()) {
    print_text(program.help());
    return report_output(/*is_result=*/true);
  }
  processes.run_collectively([&] {
    require_known_command(program, arguments);
    require_shared_command(arguments, processes);
    name_files(arguments);
    require_values(arguments);
    expand_config_file(program, arguments);
  });
  std::vector<std::string> last_first(arguments.rbegin(), arguments.rend());  // for CLI11
  try {
    program.parse(last_first);
  } catch (const CLI::ParseError& error) {  // the same in all processes
    if (error.get_exit_code() != 0) {
      const CLI::App& command = called_command(program);
      throw distributed::SharedError(fmt::format("{}; `{} {}` lists the options",
                                                 parse_fault(command, arguments, error),
                                                 command_name(program), help_flag_of(command)));
    }
    print_answer(program, error);
    return report_output(/*is_result=*/true);
  }
  return report_output(prints_its_result(program));
}

// Reports a fault of one process alone and ends the others, which wait for it.
int fail_alone(const distributed::Session& session, int status, const std::string& message) {
  const std::string who = session.communicator().size() == 1
                              ? ""
                              : fmt::format(" process {} of {}:", session.communicator().rank() + 1,
                                            session.communicator().size());
  say("tomofield:{} {}\n", who, message);
  std::fflush(nullptr);
  session.abort(status);
  return status;
}

}  // namespace

int run_program(int argc, char** argv, const distributed::Session& session) {
  const distributed::Communicator& processes = session.communicator();
  // Only the first process prints.
  if (!processes.is_root() && std::freopen("/dev/null", "w", stdout) == nullptr) return 1;
  if (processes.is_root()) base::set_log_sink(print_log);
  tell_scratch_faults();
  base::share_machine_with(processes.size_on_machine());
  const auto tell = [&](const char* message) {
    if (processes.is_root()) say("tomofield: {}\n", message);
  };
  CLI::App program{
      "tomofield: clean tomograms and compact models from aligned tilt series by continuous "
      "density fields",
      "tomofield"};
  add_version_flag(program);
  program.formatter(std::make_shared<HelpFormatter>());
  program.require_subcommand(1);
  add_help_all(program);
  program.footer(
      "`tomofield COMMAND --help` shows what most people use, and `--help-all` in its place shows "
      "all.\n"
      "Example: tomofield reconstruct TS_01/ -o TS_01.mrc   (the folder of an eTomo project)");
  add_commands(program, processes);
  add_examples(program);
  try {
    return run_command(program, {argv + 1, argv + argc}, processes);
  } catch (const distributed::SharedError& error) {
    tell(error.what());
    return 2;
  } catch (const ExitStatus& exit) {
    tell(exit.what());
    return exit.status();
  } catch (const Error& error) {
    return fail_alone(session, 2, error.what());
  } catch (const std::bad_alloc&) {
    return fail_alone(session, 2,
                      "the system has no more memory to give: end other programs, or reduce "
                      "the problem (a larger --bin or --voxel-size, a smaller --roi, --box or "
                      "--thickness, fewer --threads)");
  } catch (const std::filesystem::filesystem_error& error) {
    return fail_alone(
        session, 2,
        fmt::format("'{}' cannot be used: {}", error.path1().string(), error.code().message()));
  } catch (const std::exception& error) {
    return fail_alone(session, 1,
                      fmt::format("internal error, please report it: {}", error.what()));
  }
}

}  // namespace tomofield::cli
