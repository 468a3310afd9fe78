#include "option_table/setting.h"

#include <fmt/format.h>

#include <algorithm>
#include <nlohmann/json.hpp>
#include <span>
#include <utility>

#include "base/utf8.h"
#include "option_table/values.h"

namespace tomofield::option_table {

void note_settings(std::vector<Setting> settings, Choices& choices) {
  for (const Row& row : all_rows()) {
    const bool is_set = std::ranges::any_of(settings, [&](const Setting& setting) {
      return row.flag == setting.option && setting.instead.empty();
    });
    if (!is_set) continue;
    visit_value(row, choices, []<typename T>(T& value) {
      if constexpr (requires { value.origin(); }) value = {*value, Origin::kProject};
    });
  }
  choices.options.settings = std::move(settings);
}

void note_replaced_settings(Choices& choices) {
  for (Setting& setting : choices.options.settings) {
    const std::span<const Row> rows = rows_of_flag(setting.option);
    if (rows.empty() || !setting.instead.empty()) continue;  // an option of another command
    Choices as_set = choices;
    set_flag_from_text(setting.option, setting.value, as_set);
    const bool is_replaced = std::ranges::any_of(
        rows, [&](const Row& row) { return text_of(row, as_set) != text_of(row, choices); });
    if (is_replaced)
      setting.instead = fmt::format("{} {}", setting.option, flag_text_of(setting.option, choices));
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
