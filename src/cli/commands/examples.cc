#include "cli/commands/examples.h"

#include <fmt/format.h>

#include <string>
#include <string_view>
#include <utility>

#include "cli/options/common_options.h"

namespace tomofield::cli {
namespace {

// The words after the name of a command.
constexpr std::pair<std::string_view, std::string_view> kExamples[] = {
    {"baseline", "tv TS_01/ -o TS_01_tv.mrc"},
    {"export", "TS_01.h5 --voxel-size 20 -o TS_01_20A.mrc"},
    {"view", "TS_01.h5"},
    {"evaluate", "TS_01.mrc truth.mrc"},
    {"compare", "TS_01.mrc --tlt TS_01.tlt --thickness 1200 -o comparison"},
    {"simulate", "cell --size 256 --seed 1"},
    {"info", "TS_01.mrc --tlt TS_01.tlt"}};

std::string words_for(const CLI::App& command) {
  for (const auto& [name, words] : kExamples)
    if (name == command.get_name()) return std::string(words);
  return {};
}

void add_example(CLI::App& command, const std::string& words) {
  const bool has_more = command.get_help_all_ptr() != nullptr;
  command.footer(
      fmt::format("{}Example: {} {}",
                  has_more ? "`--help` shows what most people use, `--help-all` all.\n" : "",
                  full_name(command), words));
}

}  // namespace

void add_examples(CLI::App& program) {
  for (CLI::App* command : program.get_subcommands(nullptr)) {
    const std::string words = words_for(*command);
    if (words.empty() || command->get_footer() != program.get_footer()) continue;
    add_example(*command, words);
    for (CLI::App* method : command->get_subcommands(nullptr))
      add_example(*method, fmt::format("TS_01/ -o TS_01_{}.mrc", method->get_name()));
  }
}

}  // namespace tomofield::cli
