#include <CLI/CLI.hpp>
#include <string>
#include <vector>

#include "cli/options/config_file.h"
#include "fuzz_input.h"
#include "option_table/values.h"

namespace {

using namespace tomofield;

// A command with all options of the table, each of which is read as the command line reads it.
struct Command {
  CLI::App program;
  option_table::Choices choices;

  Command() {
    CLI::App* command = program.add_subcommand("reconstruct");
    for (const option_table::Row& row : option_table::all_rows()) {
      const std::string flag(row.flag);
      if (flag[0] != '-' || command->get_option_no_throw(flag) != nullptr) continue;
      if (option_table::is_flag(row)) {
        command->add_flag(flag);
      } else {
        command->add_option_function<std::string>(flag, [this, &row](const std::string& text) {
          option_table::set_from_text(row, text, choices);
        });
      }
    }
  }
};

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  const fuzz::InputFile file(data, size);
  fuzz::refuse_or([&] {
    Command command;
    std::vector<std::string> arguments{"reconstruct", "--config", file.path()};
    cli::expand_config_file(command.program, arguments);
    try {
      std::vector<std::string> last_first(arguments.rbegin(), arguments.rend());
      command.program.parse(last_first);
    } catch (const CLI::ParseError&) {
    }
    option_table::range_faults(command.choices.options);
  });
  return 0;
}
