#pragma once

#include <CLI/CLI.hpp>
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
  return command
      .add_option_function<std::string>(
          flag, [&target](const std::string& name) { target = *base::enum_named<Enum>(name); },
          help)
      ->check(CLI::IsMember(names));
}

}  // namespace tomofield::cli
