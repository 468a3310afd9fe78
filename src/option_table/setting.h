#pragma once

#include <nlohmann/json_fwd.hpp>
#include <span>
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

}  // namespace tomofield::option_table
