#include "cli/options/given_options.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>

#include "cli/options/table_options.h"
#include "option_table/setting.h"

namespace tomofield::cli {

std::vector<option_table::GivenOption> given_options(const CLI::App& command,
                                                     const std::vector<std::string>& except) {
  std::vector<option_table::GivenOption> given;
  for (const CLI::Option* option : command.get_options()) {
    if (option->count() == 0 || std::ranges::count(except, option->get_name()) > 0) continue;
    option_table::GivenOption& added = given.emplace_back();
    if (!option->get_positional() || !option->get_lnames().empty()) added.flag = option->get_name();
    if (option->get_items_expected_max() > 0)
      added.value = fmt::format("{}", fmt::join(option->results(), ","));
  }
  return given;
}

void note_origins(const CLI::App& command, const std::vector<Setting>& settings,
                  option_table::Choices& choices) {
  option_table::note_settings(settings, choices);
  for (const CLI::Option* option : command.get_options()) {
    const option_table::Row* row = option->count() == 0 ? nullptr : row_of_option(*option);
    if (row == nullptr) continue;
    const bool is_of_file = std::ranges::any_of(settings, [&](const Setting& setting) {
      return setting.instead.empty() && option->check_name(setting.option);
    });
    if (!is_of_file) choices.options.given.emplace_back(row->flag);
  }
}

}  // namespace tomofield::cli
