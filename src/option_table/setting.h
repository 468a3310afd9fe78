#pragma once

#include <nlohmann/json_fwd.hpp>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "option_table/rows.h"
#include "tomofield/options.h"

namespace tomofield::option_table {

/// Notes the settings that the files of a project made among the options, and gives the values that
/// they set their origin.
void note_settings(std::vector<Setting> settings, Choices& choices);

/// Returns those of Options::settings whose values the options still have: a user may have gone
/// over others.
std::vector<Setting> settings_in_use(const Choices& choices);

/// Returns settings as an array of objects with the members of Setting, for the metrics.
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
