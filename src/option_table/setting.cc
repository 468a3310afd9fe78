#include "option_table/setting.h"

#include <fmt/format.h>

#include <algorithm>
#include <nlohmann/json.hpp>
#include <span>
#include <string_view>
#include <utility>

#include "base/utf8.h"
#include "option_table/values.h"
#include "tomofield/error.h"

namespace tomofield::option_table {

namespace {

constexpr std::string_view kStack = "stack";

// Returns an option and its value as somebody gave it: "--thickness 200", "--overwrite".
std::string as_given(std::string_view flag, const Choices& choices) {
  const std::string value = flag_text_of(flag, choices);
  const bool is_set_flag = is_flag(rows_of_flag(flag).front()) && value == "true";
  return is_set_flag ? std::string(flag) : fmt::format("{} {}", flag, value);
}

bool is_given(const Row& row, const Choices& choices) {
  return origin_of(row, choices) == Origin::kGiven;
}

// Returns what was given in place of an option: its rival, or an option that it does not go with.
// Returns an empty text if there is no such option.
std::string given_against(const Row& row, const Choices& choices) {
  if (!row.rival.empty() && is_given(row_of(row.rival), choices))
    return as_given(row_of(row.rival).flag, choices);
  const bool is_of_dark =
      row.key == "input.log" || row.key == "input.log_base" || row.key == "input.defocus_um";
  if (is_of_dark && choices.options.views.contrast == Contrast::kBright) return "--contrast bright";
  const bool is_transfer = row.group == Group::kTransfer && row.key != "input.voltage_kV";
  if (is_transfer && choices.options.fit.engine == Engine::kRay) return "--engine ray";
  return {};
}

// Returns what holds in place of a setting that is to be applied, or an empty text.
std::string winner_over(const Setting& setting, const Choices& choices) {
  if (setting.option == kStack) return {};  // the project itself was given
  for (const Row& row : rows_of_flag(setting.option))
    if (is_given(row, choices)) return as_given(row.flag, choices);
  return given_against(rows_of_flag(setting.option).front(), choices);
}

void set_from_setting(const Setting& setting, Choices& choices) {
  const std::string wanted = set_flag_from_text(setting.option, setting.value, choices);
  if (!wanted.empty())
    throw Error(fmt::format("'{}': {} must be {}, not '{}'", setting.file.string(), setting.entry,
                            wanted, setting.value));
  for (const Row& row : rows_of_flag(setting.option))
    if (const std::string fault = range_fault(row, choices); !fault.empty())
      throw Error(fmt::format("'{}': {} cannot be '{}': {}", setting.file.string(), setting.entry,
                              setting.value, fault));
}

bool is_as_set(const Setting& setting, const Choices& choices) {
  Choices as_set = choices;
  set_flag_from_text(setting.option, setting.value, as_set);
  return std::ranges::all_of(rows_of_flag(setting.option), [&](const Row& row) {
    return text_of(row, as_set) == text_of(row, choices);
  });
}

// Returns true if a setting that holds has set the option with this key.
bool is_of_setting(std::string_view key, const Choices& choices) {
  return std::ranges::any_of(choices.options.settings, [&](const Setting& setting) {
    return setting.instead.empty() && setting.option == row_of(key).flag;
  });
}

void reset(const Row& row, Choices& choices) {
  const Choices usual;
  std::visit([&](auto reference) { reference(choices) = reference(const_cast<Choices&>(usual)); },
             row.member);
}

}  // namespace

void apply_settings(std::vector<Setting> settings, Choices& choices) {
  const Choices given = choices;
  for (Setting& setting : settings) {
    setting.instead = winner_over(setting, given);
    if (setting.instead.empty()) set_from_setting(setting, choices);
  }
  note_settings(settings, choices);
}

void note_settings(std::span<const Setting> settings, Choices& choices) {
  for (const Setting& setting : settings) {
    choices.options.settings.push_back(setting);
    if (!setting.instead.empty()) continue;
    std::erase(choices.options.given, setting.option);
    for (const Row& row : rows_of_flag(setting.option)) {
      visit_value(row, choices, []<typename T>(T& value) {
        if constexpr (requires { value.origin(); }) value = {*value, Origin::kProject};
      });
    }
  }
}

void settle_settings(Choices& choices) {
  for (Setting& setting : choices.options.settings) {
    const std::span<const Row> rows = rows_of_flag(setting.option);
    if (rows.empty()) continue;              // of another command
    if (!setting.instead.empty()) continue;  // has lost already
    const Row& row = rows.front();
    if (!is_as_set(setting, choices)) {
      setting.instead = as_given(row.flag, choices);
      continue;
    }
    // A rival that the same project set is no choice of the user.
    if (!row.rival.empty() && is_of_setting(row.rival, choices)) continue;
    setting.instead = given_against(row, choices);
    if (setting.instead.empty()) continue;
    for (const Row& of_flag : rows) reset(of_flag, choices);
  }
}

nlohmann::json settings_json(std::span<const Setting> settings) {
  nlohmann::json list = nlohmann::json::array();
  for (const Setting& setting : settings) {
    list.push_back({{"option", setting.option},
                    {"value", base::utf8_text(setting.value)},
                    {"file", base::utf8_text(setting.file.string())},
                    {"entry", base::utf8_text(setting.entry)}});
    if (!setting.row.empty()) list.back()["row"] = base::utf8_text(setting.row);
    if (!setting.instead.empty()) list.back()["instead"] = base::utf8_text(setting.instead);
  }
  return list;
}

}  // namespace tomofield::option_table
