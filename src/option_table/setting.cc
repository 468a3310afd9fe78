#include "option_table/setting.h"

#include <nlohmann/json.hpp>

#include "base/utf8.h"

namespace tomofield::option_table {

nlohmann::json to_json(std::span<const Setting> settings) {
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
