#include "cli/options/given_options.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>

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

}  // namespace tomofield::cli
