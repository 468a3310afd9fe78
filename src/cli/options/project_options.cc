#include "cli/options/project_options.h"

#include <fmt/format.h>

#include <optional>
#include <string_view>
#include <system_error>
#include <vector>

#include "base/log.h"
#include "cli/options/help_formatter.h"
#include "cli/options/table_options.h"
#include "cli/terminal/console.h"
#include "io/tables/view_table.h"
#include "option_table/setting.h"
#include "option_table/values.h"
#include "projects/project.h"
#include "tomofield/error.h"

namespace tomofield::cli {
namespace {

constexpr const char* kSeries = "--series";

std::vector<std::string> given_flags(const CLI::App& command) {
  std::vector<std::string> flags;
  for (const CLI::Option* option : command.get_options()) {
    const option_table::Row* row = option->count() == 0 ? nullptr : row_of_option(*option);
    if (row != nullptr) flags.emplace_back(row->flag);
  }
  return flags;
}

std::optional<projects::Project> read_project(const CLI::App& command,
                                              const option_table::Choices& choices) {
  const CLI::Option& series = *command.get_option(kSeries);
  return projects::read_project(
      {.path = choices.files.stack,
       .ignored = option_table::split_names(choices.options.views.ignore),
       .series = series.count() == 0 ? "" : series.results().front(),
       .has_mdoc = choices.files.mdoc.has_value(),
       .has_transfer = choices.options.views.defocus_um || choices.files.ctf,
       .exclude = choices.options.views.exclude,
       .has_detector = choices.files.mtf || choices.files.ctf == "none",
       .pixel_size_A = choices.options.views.pixel_size_A});
}

void print_setting(const Setting& setting, std::string_view remark) {
  print("{} {} from {}: {}{}\n", setting.option, setting.value, setting.file.string(),
        setting.entry, remark);
}

// Returns the settings that a command has options for, and prints the others.
std::vector<Setting> settings_for(const CLI::App& command, const projects::Project& project) {
  std::vector<Setting> settings;
  for (const Setting& setting : project.settings()) {
    if (command.get_option_no_throw(setting.option) != nullptr)
      settings.push_back(setting);
    else
      print_setting(setting, " (for reconstruct)");
  }
  return settings;
}

}  // namespace

std::string fault_of_stack(const std::filesystem::path& stack) {
  std::error_code fault;
  if (io::without_half(stack) != stack || std::filesystem::exists(stack, fault) || fault) return {};
  return fmt::format("'{}' does not exist", stack.string());
}

void add_project_options(CLI::App& command) {
  command
      .add_option_function<std::string>(
          kSeries, [](const std::string&) {},
          "One tilt series of a project that has several, by its name")
      ->type_name("NAME")
      ->group(kProjectGroup);
}

void open_project(const CLI::App& command, option_table::Choices& choices) {
  if (const std::string fault = fault_of_stack(choices.files.stack); !fault.empty())
    throw Error(fault);
  choices.options.given = given_flags(command);
  const std::optional<projects::Project> project = read_project(command, choices);
  if (!project) return;
  option_table::apply_settings(settings_for(command, *project), choices);
  for (const Setting& setting : choices.options.settings) {
    print_setting(setting, setting.instead.empty()
                               ? ""
                               : fmt::format(" (not used: {} is given)", setting.instead));
  }
  flush_output();  // settings come before other output, in a file too
  for (const std::string& warning : project->warnings()) base::log_warning(warning);
}

}  // namespace tomofield::cli
