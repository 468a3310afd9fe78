#pragma once

#include <nlohmann/json_fwd.hpp>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "option_table/rows.h"
#include "tomofield/options.h"

namespace tomofield::option_table {

/// Sets an option to what a text says, as the command line and the configuration file write it:
/// "24", "dark", "0,0,512,512", "auto" for options that can be chosen automatically, "true" and
/// "false" for flags. A Choice gets this origin. Returns what the text must be if it cannot be
/// read, else an empty text. Ranges are checked by range_faults().
std::string set_from_text(const Row& row, std::string_view text, Choices& choices,
                          Origin origin = Origin::kGiven);

/// Sets the rows of a flag, one from each part of a list ("--center 12,3"). A flag without a value
/// takes "true". Returns what the text must be if it cannot be read, else an empty text.
std::string set_flag_from_text(std::string_view flag, const std::string& text, Choices& choices);

/// Returns the value of an option as set_from_text() reads it, or nothing if it is to be chosen
/// automatically or is an empty text.
std::optional<std::string> text_of(const Row& row, const Choices& choices);

/// Returns the value of a flag as set_flag_from_text() reads it; "none" where nothing is chosen.
std::string flag_text_of(std::string_view flag, const Choices& choices);

/// Stands for the value of an option that has none.
inline constexpr const char* kNoValue = "–";

/// Returns the value of an option for people who read what a run was made with: "on" and "off" as
/// its flag means them (--no-margin is on if the margin is off), numbers with six digits.
std::string shown_text(const Row& row, const Choices& choices);

/// Returns what stands for the value of an option in the help: "FILE", "dark|bright".
std::string label_of(const Row& row);

/// Returns true if an option is a flag without a value.
bool is_flag(const Row& row);

/// Returns a sentence if the number of an option is out of its range: "--rank must be from 1 to
/// 256, not 0", else an empty text. A number whose default is out of its range is required.
std::string range_fault(const Row& row, const Choices& choices);
/// Returns these sentences for all options.
std::vector<std::string> range_faults(const Options& options);

/// Returns all options as nested objects, named after the keys of the table. Options that have no
/// value are null.
nlohmann::json to_json(const Choices& choices);

/// Returns where the value of an option comes from. One that is no Choice is given if
/// Options::given names its flag, or if it is not its default.
Origin origin_of(const Row& row, const Choices& choices);

/// Fills in the options whose automatic value depends on the contrast: the scale of the views and
/// the activation.
void choose_by_contrast(Options& options);

/// Returns the names in the list of an option such as --ignore, "LOCALFILE, LOG", without the empty
/// ones.
std::vector<std::string> split_names(std::string_view list);

/// Returns true if a name is among others, in upper or lower case.
bool has_name(const std::vector<std::string>& names, std::string_view name);

}  // namespace tomofield::option_table
