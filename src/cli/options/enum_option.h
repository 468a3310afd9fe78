#pragma once

#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <string>
#include <vector>

#include "base/enum_names.h"

namespace tomofield::cli {

/// Adds an option whose value is one of an enum's names (base/enum_names.h). `target` is the enum
/// or a std::optional of it.
template <typename Enum, typename Target>
CLI::Option* add_enum_option(CLI::App& command, const std::string& flag, Target& target,
                             const std::string& help) {
  std::vector<std::string> names;
  for (const auto& [value, name] : base::EnumNames<Enum>::kNames) names.emplace_back(name);
  const auto check = [names](const std::string& text) {
    return std::ranges::count(names, text) > 0
               ? std::string()
               : fmt::format("must be {}, not '{}'", fmt::join(names, " or "), text);
  };
  return command
      .add_option_function<std::string>(
          flag, [&target](const std::string& name) { target = *base::enum_named<Enum>(name); },
          help)
      ->check(CLI::Validator(check, ""))
      ->type_name(fmt::format("{}", fmt::join(names, "|")));
}

}  // namespace tomofield::cli
