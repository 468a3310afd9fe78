#include "cli/options/table_options.h"

#include <fmt/format.h>

#include <string>
#include <vector>

#include "cli/options/project_options.h"

namespace tomofield::cli {
namespace {

using option_table::Choices;
using option_table::Group;
using option_table::Row;

CLI::Option* add_flag(CLI::App& command, const Row& row, Choices& choices) {
  return command.add_flag_callback(
      std::string(row.flag),
      [&row, &choices] { option_table::set_flag_from_text(row.flag, "true", choices); },
      std::string(row.help));
}

std::string default_text(const Row& row, const Choices& choices) {
  if (row.is_of_project) return "that of a project, or required";
  if (!row.automatic.empty()) return std::string(row.automatic);
  return option_table::text_of(row, choices).value_or("");
}

CLI::Option* add_value(CLI::App& command, const Row& row, Choices& choices) {
  const auto check = [&row](const std::string& text) -> std::string {
    Choices scratch;
    const std::string wanted = option_table::set_flag_from_text(row.flag, text, scratch);
    return wanted.empty() ? "" : fmt::format("must be {}, not '{}'", wanted, text);
  };
  return command
      .add_option_function<std::string>(
          std::string(row.flag),
          [&row, &choices](const std::string& text) {
            option_table::set_flag_from_text(row.flag, text, choices);
          },
          std::string(row.help))
      ->check(CLI::Validator(check, ""))
      ->type_name(option_table::label_of(row))
      ->default_str(default_text(row, choices));
}

}  // namespace

CLI::Option* add_row(CLI::App& command, const Row& row, Choices& choices) {
  CLI::Option* option = option_table::is_flag(row) ? add_flag(command, row, choices)
                                                   : add_value(command, row, choices);
  // CLI11 lists positional arguments apart.
  if (row.group != Group::kSeries) option->group(std::string(option_table::title_of(row.group)));
  // If a project may state the value, range_faults() misses it after the project is opened.
  return option->required(row.is_required && !row.is_of_project);
}

CLI::Option* add_row(CLI::App& command, std::string_view key, Choices& choices,
                     std::string_view group) {
  const Row& row = option_table::row_of(key);
  CLI::Option* option = add_row(command, row, choices);
  if (group.empty()) return option;
  // The command has a default of its own.
  option->default_str(option_table::text_of(row, choices).value_or(std::string(row.automatic)));
  return option->group(std::string(group));
}

void add_groups(CLI::App& command, Choices& choices, std::initializer_list<Group> groups) {
  for (const Group group : groups) {
    for (const Row& row : option_table::all_rows()) {
      if (row.group == group && &option_table::rows_of_flag(row.flag).front() == &row)
        add_row(command, row, choices);
    }
  }
}

void add_series_options(CLI::App& command, Choices& choices) {
  add_groups(command, choices, {Group::kAlignment, Group::kImages, Group::kMasks});
}

void add_input_options(CLI::App& command, Choices& choices) {
  add_groups(command, choices, {Group::kSeries});
  add_project_options(command);
  add_series_options(command, choices);
}

void add_place_options(CLI::App& command, Choices& choices) {
  for (const char* key : {"specimen.roi", "specimen.hand", "specimen.axis_x", "field.with_margin"})
    add_row(command, key, choices);
}

const Row* row_of_option(const CLI::Option& option) {
  for (const Row& row : option_table::all_rows()) {
    const std::string flag(row.flag);
    const bool has_name = option.check_name(flag.substr(flag.rfind(',') + 1));
    if (has_name && (option.get_positional() || option.get_group() == title_of(row.group)))
      return &row;
  }
  return nullptr;
}

}  // namespace tomofield::cli
