#include "report/reported_options.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <array>
#include <span>
#include <string_view>

#include "option_table/rows.h"
#include "option_table/values.h"

namespace tomofield::report {
namespace {

using nlohmann::json;
using option_table::Row;

// The options that trials may choose: the last two with --tune alone.
constexpr std::array<std::string_view, 8> kOfTrials{
    "fit.penalty",       "fit.density_variation",  "fit.fit_view_scale", "fit.spike_rank",
    "input.black_level", "input.bead_diameter_nm", "fit.epochs",         "field.rank"};

constexpr const char* kNoValue = "–";

// Returns the value under a key such as "fit.epochs", or nothing if the record does not have it.
const json* value_under(const json& options, std::string_view key) {
  const json* at = &options;
  while (true) {
    const std::size_t dot = key.find('.');
    const auto found = at->find(std::string(key.substr(0, dot)));
    if (found == at->end()) return nullptr;
    at = &*found;
    if (dot == std::string_view::npos) return at;
    key.remove_prefix(dot + 1);
  }
}

std::string text_of(const json& value) {
  if (value.is_null()) return kNoValue;
  if (value.is_string()) return value.get_ref<const std::string&>().empty() ? kNoValue : value;
  if (value.is_boolean()) return value.get<bool>() ? "on" : "off";
  if (value.is_number_float()) return fmt::format("{:.6g}", value.get<double>());
  if (!value.is_array()) return value.dump();
  std::vector<std::string> texts;
  for (const json& item : value) texts.push_back(text_of(item));
  return fmt::format("{}", fmt::join(texts, ", "));
}

// Returns the last of an option's names: "--output" of "-o,--output".
std::string_view long_flag(const Row& row) { return row.flag.substr(row.flag.rfind(',') + 1); }

// Says whether an entry of "origins" means this option, by its flag, its key or its name.
bool is_of(const json& origin, const Row& row) {
  const std::string option = origin.value("option", "");
  return !option.empty() && (option == long_flag(row) || "--" + option == long_flag(row) ||
                             option == row.key || option == row.name);
}

std::string place_of(const json& origin) {
  const std::string file = origin.value("file", ""), entry = origin.value("entry", "");
  return entry.empty() ? file : file + ": " + entry;
}

json origins_of(const json& record) {
  for (const json* object : {&record, &record.at("metrics")})
    if (const auto found = object->find("origins"); found != object->end() && found->is_array())
      return *found;
  return json::array();
}

// Returns the default of an option as to_json() writes it, and what was asked for.
struct Wish {
  json usual, wanted;
};

Wish wish_of(const Row& row, const json& defaults, const json& requested) {
  const json *usual = value_under(defaults, row.key), *wanted = value_under(requested, row.key);
  return {usual ? *usual : json(), wanted ? *wanted : json()};
}

// Returns the keys of the options that trials of this run chose.
std::span<const std::string_view> chosen_by_trials(const json& record) {
  if (!record.at("metrics").value("tuning", json()).is_object()) return {};
  const bool is_tuned = record.at("options").value("tune", false);
  return std::span(kOfTrials).first(kOfTrials.size() - (is_tuned ? 0 : 2));
}

// Returns the text of a value as the user types it: --no-margin is on if the margin is off.
std::string typed_text(const Row& row, const json& value) {
  if (value.is_boolean() && row.flag.starts_with("--no-")) return text_of(!value.get<bool>());
  return text_of(value);
}

ReportedOption reported(const Row& row, const json& value, const Wish& wish,
                        std::span<const std::string_view> of_trials) {
  ReportedOption option{.flag = std::string(long_flag(row)),
                        .value = typed_text(row, value),
                        .origin = "default",
                        .meaning = std::string(row.help)};
  if (wish.wanted != wish.usual) {
    option.origin = "given";
  } else if (value != wish.wanted) {
    const bool is_of_trials = std::ranges::find(of_trials, row.key) != of_trials.end();
    option.origin = is_of_trials ? "chosen by trials" : "chosen automatically";
  } else {
    option.is_default = true;
  }
  return option;
}

// Joins the options of rows that share a flag, as --center does, and adds their unit.
ReportedOption joined(const std::vector<ReportedOption>& parts, std::string_view unit) {
  ReportedOption option = parts.front();
  for (std::size_t i = 1; i < parts.size(); ++i) {
    if (parts[i].is_default) continue;
    option.value += ", " + parts[i].value;
    if (option.is_default) option.origin = parts[i].origin;
    option.is_default = false;
  }
  if (option.value != kNoValue && !unit.empty()) option.value += fmt::format(" {}", unit);
  return option;
}

// Returns the rows that share the flag of the first one.
std::span<const Row> rows_of_flag(std::span<const Row> rows) {
  const auto other =
      std::ranges::find_if(rows, [&](const Row& row) { return row.flag != rows.front().flag; });
  return rows.first(static_cast<std::size_t>(other - rows.begin()));
}

}  // namespace

std::vector<ReportedOption> reported_options(const json& record, const SeriesFiles& files,
                                             const Options& requested) {
  const json defaults = option_table::to_json({}, {});
  const json wanted = option_table::to_json(files, requested);
  const auto of_trials = chosen_by_trials(record);
  json origins = origins_of(record);
  std::vector<ReportedOption> options;
  std::span<const Row> left = option_table::all_rows();
  while (!left.empty()) {
    const std::span<const Row> rows = rows_of_flag(left);
    left = left.subspan(rows.size());
    std::vector<ReportedOption> parts;
    for (const Row& row : rows) {
      const json* const value = value_under(record.at("options"), row.key);
      if (value != nullptr)
        parts.push_back(reported(row, *value, wish_of(row, defaults, wanted), of_trials));
    }
    if (parts.empty()) continue;
    options.push_back(joined(parts, rows.front().unit));
    const auto origin = std::ranges::find_if(origins, [&](const json& entry) {
      return std::ranges::any_of(rows, [&](const Row& row) { return is_of(entry, row); });
    });
    if (origin == origins.end()) continue;
    options.back().origin = place_of(*origin);
    options.back().is_default = false;
    origins.erase(origin);
  }
  for (const json& origin : origins)
    options.push_back({.flag = origin.value("option", ""),
                       .value = text_of(origin.value("value", json())),
                       .origin = place_of(origin),
                       .meaning = ""});
  return options;
}

}  // namespace tomofield::report
