#include "report/reported_options.h"

#include <fmt/format.h>

#include <algorithm>
#include <span>
#include <string_view>

#include "option_table/rows.h"
#include "option_table/values.h"

namespace tomofield::report {
namespace {

using option_table::Row;

// These options say where the results are, not what they are made from.
constexpr std::string_view kOfFiles = "running.";

// Returns the last of an option's names: "--output" of "-o,--output".
std::string_view long_flag(const Row& row) { return row.flag.substr(row.flag.rfind(',') + 1); }

std::string place_of(const Setting& setting) {
  return setting.entry.empty() ? setting.file.string()
                               : setting.file.string() + ": " + setting.entry;
}

// Says where the value of an option comes from that a file sets, and what does not hold.
std::string origin_of(const Setting& setting, const std::string& origin) {
  if (setting.instead.empty()) return place_of(setting);
  const bool is_same_option = setting.instead.starts_with(setting.option + " ");
  return fmt::format("{}, in place of {} ({})", is_same_option ? origin : setting.instead,
                     setting.value, place_of(setting));
}

const char* text_of(Origin origin) {
  switch (origin) {
    case Origin::kDefault:
      return "default";
    case Origin::kGiven:
      return "given";
    case Origin::kProject:
      return "project";
    case Origin::kDerived:
      return "chosen automatically";
    case Origin::kTrial:
      return "chosen by trials";
  }
  return "";
}

ReportedOption reported(const Row& row, const option_table::Choices& choices) {
  const Origin origin = option_table::origin_of(row, choices);
  return {.flag = std::string(long_flag(row)),
          .value = option_table::shown_text(row, choices),
          .origin = text_of(origin),
          .meaning = std::string(row.help),
          .is_default = origin == Origin::kDefault};
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
  if (option.value != option_table::kNoValue && !unit.empty())
    option.value += fmt::format(" {}", unit);
  return option;
}

}  // namespace

std::vector<ReportedOption> reported_options(const SeriesFiles& files, const Options& options) {
  const option_table::Choices choices{files, options};
  std::vector<Setting> settings = options.settings;
  std::vector<ReportedOption> reported_ones;
  std::span<const Row> left = option_table::all_rows();
  while (!left.empty()) {
    const std::span<const Row> rows = option_table::rows_of_flag(left.front().flag);
    left = left.subspan(rows.size());
    if (rows.front().key.starts_with(kOfFiles)) continue;
    std::vector<ReportedOption> parts;
    for (const Row& row : rows) parts.push_back(reported(row, choices));
    reported_ones.push_back(joined(parts, rows.front().unit));
    const auto setting = std::ranges::find(settings, long_flag(rows.front()), &Setting::option);
    if (setting == settings.end()) continue;
    reported_ones.back().origin = origin_of(*setting, reported_ones.back().origin);
    reported_ones.back().is_default = false;
    settings.erase(setting);
  }
  for (const Setting& setting : settings)
    reported_ones.push_back({.flag = setting.option,
                             .value = setting.value,
                             .origin = origin_of(setting, ""),
                             .meaning = ""});
  return reported_ones;
}

}  // namespace tomofield::report
