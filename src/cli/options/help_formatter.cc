#include "cli/options/help_formatter.h"

#include <fmt/format.h>

#include <algorithm>
#include <sstream>
#include <string_view>
#include <vector>

#include "cli/options/table_options.h"

namespace tomofield::cli {
namespace {

constexpr std::size_t kColumns = 100, kIndent = 30;

// Counts the characters of a UTF-8 text.
std::size_t width_of(std::string_view text) {
  return static_cast<std::size_t>(
      std::ranges::count_if(text, [](char c) { return (c & 0xc0) != 0x80; }));
}

// Puts a text beside a name, wrapped at the right of the screen.
std::string entry(const std::string& name, const std::string& text) {
  std::string lines = "  " + name;
  std::size_t column = 2 + width_of(name);
  if (column + 2 > kIndent) {
    lines += '\n';
    column = 0;
  }
  lines.append(kIndent - column, ' ');
  column = kIndent;
  std::istringstream words(text);
  for (std::string word; words >> word;) {
    if (column > kIndent && column + 1 + width_of(word) > kColumns) {
      lines += '\n' + std::string(kIndent, ' ');
      column = kIndent;
    }
    if (column > kIndent) {
      lines += ' ';
      ++column;
    }
    lines += word;
    column += width_of(word);
  }
  return lines + '\n';
}

std::string names_of(const std::set<CLI::Option*>& options) {
  std::vector<std::string> names;
  for (const CLI::Option* option : options) names.push_back(option->get_name());
  return fmt::format("{}", fmt::join(names, ", "));
}

// Returns the unit, the default and the other options that it needs, in brackets.
std::string notes_of(const CLI::Option& option) {
  std::vector<std::string> notes;
  const option_table::Row* row = row_of_option(option);
  if (row != nullptr && !row->unit.empty()) notes.emplace_back(row->unit);
  if (option.get_required())
    notes.emplace_back("required");
  else if (!option.get_default_str().empty())
    notes.push_back("default: " + option.get_default_str());
  if (!option.get_needs().empty()) notes.push_back("with " + names_of(option.get_needs()));
  if (!option.get_excludes().empty())
    notes.push_back("not with " + names_of(option.get_excludes()));
  return notes.empty() ? "" : fmt::format(" ({})", fmt::join(notes, "; "));
}

bool is_shown(const CLI::Option& option, CLI::AppFormatMode mode) {
  if (mode == CLI::AppFormatMode::All) return true;
  const option_table::Row* row = row_of_option(option);
  const std::string& group = option.get_group();
  return row == nullptr ? group != kHelpAllGroup && group != kProjectGroup : row->is_common;
}

std::string usage_of(const CLI::App& command, const std::string& name) {
  std::string usage = "Usage: " + name + " [OPTIONS]";
  for (const CLI::Option* option : command.get_options()) {
    if (!option->get_positional()) continue;
    usage += option->get_required() ? " " + option->get_name() : " [" + option->get_name() + "]";
  }
  const bool has_commands = !command.get_subcommands(nullptr).empty();
  return usage + (has_commands ? " COMMAND\n" : "\n");
}

// Returns what stands for the value of an option. CLI11 has names of its own for types that the
// option table calls N and NUMBER, and puts the words of a choice behind the type.
std::string type_of(const CLI::Option& option) {
  std::string type = option.get_type_name();
  const std::size_t words = type.find(":{");
  if (words != type.npos) {
    std::string choice = type.substr(words + 2, type.size() - words - 3);
    std::ranges::replace(choice, ',', '|');
    type = type.starts_with("TEXT") ? choice : type.substr(0, words);
  }
  if (type == "INT" || type == "UINT") return "N";
  return type == "FLOAT" ? "NUMBER" : type;
}

std::string name_of(const CLI::Option& option, bool is_positional) {
  std::string name = option.get_name(is_positional, true);
  if (option.get_items_expected_max() > 0 && !option.get_type_name().empty() && !is_positional)
    name += " " + type_of(option);
  return name;
}

// Returns the beginning of a description: up to the end of its first clause outside of brackets
// that has several words. A single word says too little.
std::string first_clause(const std::string& text) {
  int depth = 0;
  bool has_words = false;
  for (std::size_t i = 0; i + 1 < text.size(); ++i) {
    const char c = text[i];
    depth += (c == '(') - (c == ')');
    if (depth != 0) continue;
    const bool is_end = (c == '.' || c == ':' || c == ';') && text[i + 1] == ' ';
    if (is_end && has_words) return text.substr(0, i);
    has_words = has_words || c == ' ';
  }
  return text;
}

// Returns an option with the beginning of its description, and its notes if they are few.
std::string short_entry(const CLI::Option& option) {
  constexpr std::size_t kMostNotes = 45;
  std::string text = first_clause(option.get_description());
  const std::string notes = notes_of(option);
  if (width_of(notes) <= kMostNotes) text += notes;
  return entry(name_of(option, option.get_positional()), text);
}

}  // namespace

std::string HelpFormatter::make_help(const CLI::App* command, std::string name,
                                     CLI::AppFormatMode mode) const {
  const bool is_short =
      mode == CLI::AppFormatMode::Normal && command->get_help_all_ptr() != nullptr;
  std::string help = command->get_description() + "\n" + usage_of(*command, name);
  if (!command->get_footer().empty()) help += command->get_footer() + "\n";
  const auto add_section = [&](const std::string& title, const auto& is_of_section) {
    std::string lines;
    for (const CLI::Option* option : command->get_options()) {
      if (!is_of_section(*option) || !is_shown(*option, mode)) continue;
      lines += is_short ? short_entry(*option) : make_option(option, option->get_positional());
    }
    if (!lines.empty()) help += "\n" + title + ":\n" + lines;
  };
  const auto add_subcommands = [&] {
    const std::vector<const CLI::App*> commands = command->get_subcommands(nullptr);
    if (!commands.empty()) help += "\nSubcommands:\n";
    for (const CLI::App* sub : commands) help += make_subcommand(sub);
  };
  if (is_short) {  // one screen
    add_section("Options", [](const CLI::Option& option) { return !option.get_group().empty(); });
    add_subcommands();
    return help;
  }
  add_section("Arguments", [](const CLI::Option& option) { return option.get_positional(); });
  for (const std::string& group : command->get_groups()) {
    if (group.empty()) continue;  // hidden options
    add_section(group, [&](const CLI::Option& option) {
      return !option.get_positional() && option.get_group() == group;
    });
  }
  add_subcommands();
  return help;
}

std::string HelpFormatter::make_option(const CLI::Option* option, bool is_positional) const {
  return entry(name_of(*option, is_positional), option->get_description() + notes_of(*option));
}

std::string HelpFormatter::make_subcommand(const CLI::App* command) const {
  return entry(command->get_name(), command->get_description());
}

void add_help_all(CLI::App& command) {
  command.set_help_all_flag("--help-all", "Print the help of all options and exit");
}

const char* help_flag_of(const CLI::App& command) {
  return command.get_help_all_ptr() == nullptr ? "--help" : "--help-all";
}

}  // namespace tomofield::cli
