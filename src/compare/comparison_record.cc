#include "compare/comparison_record.h"

#include "base/utf8.h"
#include "io/json.h"

namespace tomofield::compare {
namespace {

using nlohmann::json;

// Returns an object for each method. A figure that it does not have is null.
json methods_json(const ComparisonRecord& record) {
  const Table& table = record.table;
  json methods = json::array();
  for (std::size_t row = 0; row < table.methods.size(); ++row) {
    json entry{{"method", table.methods[row].name},
               {"command", utf8_texts(record.commands[row])},
               {"volume", base::utf8_text(record.volumes[row].string())}};
    for (std::size_t c = 0; c < table.columns.size(); ++c) {
      const auto& value = table.values[row][c];
      entry[table.columns[c].key] = value ? json(*value) : json(nullptr);
    }
    methods.push_back(std::move(entry));
  }
  return methods;
}

}  // namespace

void write_comparison(const std::filesystem::path& file, const ComparisonRecord& record) {
  io::write_json(file, {{"tomofield", TOMOFIELD_VERSION},
                        {"series", base::utf8_text(record.series.string())},
                        {"truth", record.truth ? json(base::utf8_text(record.truth->string()))
                                               : json(nullptr)},
                        {"methods", methods_json(record)}});
}

}  // namespace tomofield::compare
