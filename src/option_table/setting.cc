#include "option_table/setting.h"

#include <algorithm>
#include <nlohmann/json.hpp>
#include <utility>

#include "base/utf8.h"
#include "option_table/values.h"

namespace tomofield::option_table {

void note_settings(std::vector<Setting> settings, Choices& choices) {
  for (const Row& row : all_rows()) {
    const bool is_set = std::ranges::any_of(
        settings, [&](const Setting& setting) { return row.flag == setting.option; });
    if (!is_set) continue;
    visit_value(row, choices, []<typename T>(T& value) {
      if constexpr (requires { value.origin(); }) value = {*value, Origin::kProject};
    });
  }
  choices.options.settings = std::move(settings);
}

std::vector<Setting> settings_in_use(const Choices& choices) {
  std::vector<Setting> in_use = choices.options.settings;
  std::erase_if(in_use, [&](const Setting& setting) {
    Choices as_set = choices;
    set_flag_from_text(setting.option, setting.value, as_set);
    return std::ranges::any_of(rows_of_flag(setting.option), [&](const Row& row) {
      return text_of(row, as_set) != text_of(row, choices);
    });
  });
  return in_use;
}

nlohmann::json settings_json(std::span<const Setting> settings) {
  nlohmann::json list = nlohmann::json::array();
  for (const Setting& setting : settings) {
    list.push_back({{"option", setting.option},
                    {"value", base::utf8_text(setting.value)},
                    {"file", base::utf8_text(setting.file.string())},
                    {"entry", base::utf8_text(setting.entry)}});
    if (!setting.row.empty()) list.back()["row"] = base::utf8_text(setting.row);
  }
  return list;
}

}  // namespace tomofield::option_table
