#pragma once

#include <optional>
#include <string>

namespace tomofield::option_table {

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
