#pragma once

#include <nlohmann/json_fwd.hpp>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "option_table/rows.h"
#include "tomofield/options.h"

namespace tomofield::option_table {

/// Sets the options to the settings that the files of a project made, and notes these in
/// Options::settings. An option that somebody gave wins over the setting of a project, and so does
/// one that is given in its place (Row::rival) or that it does not go with: the setting then says
/// in Setting::instead what holds. Throws Error for a value that the option cannot have.
void apply_settings(std::vector<Setting> settings, Choices& choices);

/// Notes that options which were set already come from these files (the choice of a batch), and not
/// from who gave them.
void note_settings(std::span<const Setting> settings, Choices& choices);

/// Call this after options may have changed since apply_settings(). A setting whose option now has
/// another value, or loses to an option that was given since, is marked in Setting::instead. In the
/// second case its option returns to the default.
void settle_settings(Choices& choices);

/// Returns settings as an array of objects with the members of Setting, for the metrics. Those that
/// are empty for most settings (row, instead) are left out there.
nlohmann::json settings_json(std::span<const Setting> settings);

/// An option as somebody gave it, on the command line or in a table of series.
struct GivenOption {
  std::string flag;                  ///< "--thickness"; empty for a positional argument
  std::optional<std::string> value;  ///< nothing for an option that takes none
  bool operator==(const GivenOption&) const = default;

  /// Returns the option as one word, which also a value that begins with a minus leaves whole.
  std::string word() const {
    if (flag.empty()) return *value;
    return value ? flag + "=" + *value : flag;
  }
};

}  // namespace tomofield::option_table
