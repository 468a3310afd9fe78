#include "compare/row_record.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "base/code_text.h"
#include "base/plausible.h"
#include "base/utf8.h"
#include "io/json.h"
#include "tomofield/error.h"

namespace tomofield::compare {
namespace {

using nlohmann::json;
namespace fs = std::filesystem;

constexpr const char* kAdvice =
    "give another folder with -o, or --overwrite to make everything in this one again";

std::string command_text(const std::vector<std::string>& command) {
  return fmt::format("`{}`", shell_command(command));
}

json to_json(Progress progress) {
  switch (progress) {
    case Progress::kRunning:
      return "running";
    case Progress::kStopped:
      return "stopped";
    case Progress::kFinished:
      return "finished";
    case Progress::kNone:
      break;
  }
  return nullptr;
}

Progress progress_from(const json& value) {
  for (const Progress progress :
       {Progress::kNone, Progress::kRunning, Progress::kStopped, Progress::kFinished})
    if (to_json(progress) == value) return progress;
  throw Error("'progress' is none of a run");
}

json to_json(const RunOrigin& origin) {
  json files = json::object();
  for (const auto& [path, state] : origin.files)
    files[path] = {{"bytes", state.bytes}, {"written", state.written}};
  return {{"tomofield", origin.version}, {"command", origin.command}, {"files", files}};
}

RunOrigin origin_from(const json& object) {
  RunOrigin origin{.version = object.at("tomofield").get<std::string>(),
                   .command = object.at("command").get<std::vector<std::string>>(),
                   .files = {}};
  for (const auto& file : object.at("files").items())
    origin.files[file.key()] = {file.value().at("bytes").get<std::uintmax_t>(),
                                file.value().at("written").get<std::int64_t>()};
  return origin;
}

}  // namespace

std::vector<std::string> RunOrigin::differences_to(const RunOrigin& now) const {
  std::vector<std::string> all;
  for (const auto& [path, state] : now.files) {
    const auto before = files.find(path);
    if (before == files.end())
      all.push_back(fmt::format("it did not read '{}'", path));
    else if (before->second != state)
      all.push_back(fmt::format("'{}' has changed since", path));
  }
  for (const auto& entry : files) {
    if (!now.files.contains(entry.first)) all.push_back(fmt::format("it read '{}'", entry.first));
  }
  if (command != now.command) {
    all.push_back(fmt::format("its command was {} and now is {}", command_text(command),
                              command_text(now.command)));
  }
  if (version != now.version)
    all.push_back(fmt::format("it is of tomofield {}, and this is {}", version, now.version));
  return all;
}

std::vector<std::string> utf8_texts(const std::vector<std::string>& words) {
  std::vector<std::string> texts;
  for (const std::string& word : words) texts.push_back(base::utf8_text(word));
  return texts;
}

RunOrigin origin_of(const std::vector<std::string>& command, const std::vector<fs::path>& inputs) {
  RunOrigin origin{.version = TOMOFIELD_VERSION, .command = utf8_texts(command), .files = {}};
  for (const fs::path& path : inputs)
    origin.files[base::utf8_text(fs::absolute(path).string())] = {
        fs::file_size(path), fs::last_write_time(path).time_since_epoch().count()};
  return origin;
}

std::string not_of_this_comparison(const fs::path& file, const std::string& why) {
  return fmt::format("'{}' is not what this comparison wrote ({}): {}", file.string(), why,
                     kAdvice);
}

RowState read_row(const fs::path& file, const RunOrigin& origin) {
  if (!fs::exists(file)) return {};
  std::vector<std::string> differences;
  const auto read = [&](const json& row) {
    differences = origin_from(row.at("origin")).differences_to(origin);
    return RowState{progress_from(row.at("progress")),
                    {io::number_at(row, "core_seconds", 0, base::kLargestNumber),
                     io::number_at(row, "wall_seconds", 0, base::kLargestNumber),
                     io::integer_at(row, "peak_bytes", 0, INT64_MAX)}};
  };
  const RowState state = io::read_record(
      file, read, [&](const std::string& why) { return not_of_this_comparison(file, why); });
  if (differences.empty()) return state;
  throw Error(fmt::format("what '{}' tells of cannot be kept: {}: {}", file.string(),
                          fmt::join(differences, "; "), kAdvice));
}

void write_row(const fs::path& file, const RunOrigin& origin, const RowState& state) {
  io::write_json(file, {{"origin", to_json(origin)},
                        {"progress", to_json(state.progress)},
                        {"core_seconds", state.costs.core_seconds},
                        {"wall_seconds", state.costs.wall_seconds},
                        {"peak_bytes", state.costs.peak_bytes}});
}

std::string shell_command(const std::vector<std::string>& words) {
  std::string command = "tomofield";
  for (const std::string& word : words) command += " " + base::Shell::quoted_if_needed(word);
  return command;
}

}  // namespace tomofield::compare
