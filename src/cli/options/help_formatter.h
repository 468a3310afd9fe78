#pragma once

#include <CLI/CLI.hpp>
#include <string>

namespace tomofield::cli {

/// The groups of options outside of the table that --help-all alone shows.
inline constexpr const char* kHelpAllGroup = "Diagnosis";
inline constexpr const char* kProjectGroup = "Projects of other programs";

/// Formats help texts for a screen of 100 columns. --help shows the common options of the table
/// (option_table/rows.h) and those outside of it, --help-all shows all.
class HelpFormatter : public CLI::Formatter {
 public:
  std::string make_help(const CLI::App* command, std::string name,
                        CLI::AppFormatMode mode) const override;
  std::string make_option(const CLI::Option* option, bool is_positional) const override;
  std::string make_subcommand(const CLI::App* command) const override;
};

/// Adds --help-all to a command that has options of the table.
void add_help_all(CLI::App& command);

/// Returns the flag that lists all options of a command: --help-all, or --help without it.
const char* help_flag_of(const CLI::App& command);

}  // namespace tomofield::cli
