#include "compare/row_file.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <fstream>

#include "io/json.h"
#include "tomofield/error.h"

namespace tomofield::compare {
namespace {

using nlohmann::json;
namespace fs = std::filesystem;

constexpr const char* kAdvice =
    "give another folder with -o, or --overwrite to make everything in this one anew";

// Returns what `read` makes of a JSON file. Mistakes in the file are errors that name it.
template <typename Read>
auto read_json(const fs::path& path, Read&& read) {
  const auto fail = [&](const char* why) {
    return Error(fmt::format("'{}' is not what this comparison wrote ({}): {}", path.string(), why,
                             kAdvice));
  };
  try {
    std::ifstream file(path);
    return read(json::parse(file));
  } catch (const json::exception& fault) {
    throw fail(fault.what());
  }
}

std::string command_text(const json& command) {
  return fmt::format("`tomofield {}`", fmt::join(command.get<std::vector<std::string>>(), " "));
}

std::vector<std::string> changed_files(const json& before, const json& now) {
  std::vector<std::string> changes;
  for (const auto& [path, state] : now.items()) {
    if (!before.contains(path))
      changes.push_back(fmt::format("it did not read '{}'", path));
    else if (before.at(path) != state)
      changes.push_back(fmt::format("'{}' has changed since", path));
  }
  for (const auto& [path, state] : before.items()) {
    if (!now.contains(path)) changes.push_back(fmt::format("it read '{}'", path));
  }
  return changes;
}

// Returns the differences of two origins, a clause each.
std::vector<std::string> changes(const json& before, const json& now) {
  std::vector<std::string> all = changed_files(before.at("files"), now.at("files"));
  if (before.at("command") != now.at("command")) {
    all.push_back(fmt::format("its command was {} and now is {}", command_text(before["command"]),
                              command_text(now.at("command"))));
  }
  if (before.at("tomofield") != now.at("tomofield")) {
    all.push_back(fmt::format("it is of tomofield {}, and this is {}",
                              before.at("tomofield").get<std::string>(),
                              now.at("tomofield").get<std::string>()));
  }
  return all;
}

}  // namespace

Costs operator+(const Costs& one, const Costs& other) {
  return {one.core_seconds + other.core_seconds, one.wall_seconds + other.wall_seconds,
          std::max(one.peak_bytes, other.peak_bytes)};
}

json origin_of(const std::vector<std::string>& command, const std::vector<fs::path>& inputs) {
  json files = json::object();
  for (const fs::path& path : inputs) {
    files[fs::absolute(path).string()] = {
        {"bytes", fs::file_size(path)},
        {"written", fs::last_write_time(path).time_since_epoch().count()}};
  }
  return {{"tomofield", TOMOFIELD_VERSION}, {"command", command}, {"files", files}};
}

RowState read_row(const fs::path& file, const json& origin) {
  if (!fs::exists(file)) return {};
  return read_json(file, [&](const json& row) {
    const std::vector<std::string> differences = changes(row.at("origin"), origin);
    if (!differences.empty()) {
      throw Error(fmt::format("what '{}' tells of cannot be kept: {}: {}", file.string(),
                              fmt::join(differences, "; "), kAdvice));
    }
    return RowState{row.at("progress"),
                    {row.at("core_seconds"), row.at("wall_seconds"), row.at("peak_bytes")}};
  });
}

void write_row(const fs::path& file, const json& origin, const RowState& state) {
  io::write_json(file, {{"origin", origin},
                        {"progress", state.progress},
                        {"core_seconds", state.costs.core_seconds},
                        {"wall_seconds", state.costs.wall_seconds},
                        {"peak_bytes", state.costs.peak_bytes}});
}

json read_figures(const fs::path& file) {
  return read_json(file, [](const json& document) { return document.at("figures"); });
}

}  // namespace tomofield::compare
