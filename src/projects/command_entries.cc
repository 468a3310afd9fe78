#include "projects/command_entries.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cctype>
#include <utility>

#include "io/is_file.h"
#include "io/named_file.h"
#include "io/tables/text_lines.h"
#include "tomofield/error.h"

namespace tomofield::projects {

namespace fs = std::filesystem;
namespace {

std::string upper_case(std::string_view text) {
  std::string upper(text);
  std::ranges::transform(upper, upper.begin(),
                         [](unsigned char c) { return static_cast<char>(std::toupper(c)); });
  return upper;
}

io::Command find_command(const fs::path& file, std::string_view program) {
  std::vector<io::Command> found = io::read_command_file(file);
  std::erase_if(found, [&](const io::Command& command) { return command.program != program; });
  if (found.size() != 1) {
    throw Error(
        fmt::format("'{}' has {} commands ${}, and one is expected: give the command file "
                    "of one {}",
                    file.string(), found.size(), program,
                    program == "tilt" ? "reconstruction (tilt.com)" : "aligned stack"));
  }
  if (upper_case(found.front().arguments).find("-STANDARDINPUT") == std::string::npos) {
    throw Error(
        fmt::format("'{}', line {}: ${} does not read its entries from the lines below it "
                    "(-StandardInput), so they cannot be told: write it as eTomo does",
                    file.string(), found.front().line, program));
  }
  for (const std::string_view argument : io::split_words(found.front().arguments)) {
    if (upper_case(argument) == "-STANDARDINPUT" || upper_case(argument) == "-PID") continue;
    throw Error(
        fmt::format("'{}', line {}: '{}' stands behind ${}, and only entries on the lines "
                    "below it are read: write it there",
                    file.string(), found.front().line, io::quote(argument), program));
  }
  return std::move(found.front());
}

// Splits a list of IMOD: values between commas or white space. Nothing between two commas stands
// for a default value, and a slash ends the list.
std::vector<std::optional<std::string_view>> split_list(std::string_view text) {
  text = text.substr(0, text.find('/'));
  std::vector<std::optional<std::string_view>> values;
  while (!text.empty()) {
    const std::size_t comma = std::min(text.find(','), text.size());
    const auto words = io::split_words(text.substr(0, comma));
    values.insert(values.end(), words.begin(), words.end());
    if (words.empty() && comma < text.size()) values.emplace_back();
    text.remove_prefix(std::min(comma + 1, text.size()));
  }
  return values;
}

}  // namespace

fs::path command_file_beside(const fs::path& tilt_com, std::string_view program) {
  const std::string name = tilt_com.filename().string();
  constexpr std::string_view kTilt = "tilt";
  const std::string axis = name.starts_with(kTilt) ? name.substr(kTilt.size()) : ".com";
  const auto beside = [&](const std::string& end) {
    return tilt_com.parent_path() / (std::string(program) + end);
  };
  if (axis == ".com" || axis == "a.com" || axis == "b.com" || io::is_file(beside(axis)))
    return beside(axis);
  // A copy, tilt_thick.com, tilt2.com or tilta_thick.com, has no files of its own.
  const bool has_letter = axis.size() > 1 && (axis[0] == 'a' || axis[0] == 'b') &&
                          std::isalpha(static_cast<unsigned char>(axis[1])) == 0;
  const fs::path of_axis = beside(axis.substr(0, has_letter ? 1 : 0) + ".com");
  return io::is_file(of_axis) ? of_axis : beside(".com");
}

CommandEntries::CommandEntries(Project& project, const fs::path& file, std::string_view program)
    : project_(project), file_(file), command_(find_command(file, program)) {
  project.add_file(file);
}

const io::CommandEntry* CommandEntries::find(std::string_view name) {
  const std::string wanted = upper_case(name);
  known_.insert(wanted);
  const io::CommandEntry* found = nullptr;
  for (const io::CommandEntry& entry : command_.entries) {
    if (upper_case(entry.name) != wanted) continue;
    if (found != nullptr) {
      throw Error(fmt::format("'{}', line {}: {} comes twice, after line {}: leave one out",
                              file_.string(), entry.line, entry.name, found->line));
    }
    found = &entry;
  }
  return found == nullptr || project_.ignores(name) ? nullptr : found;
}

void CommandEntries::fail(const io::CommandEntry& entry, std::string_view expected) const {
  throw Error(fmt::format("'{}', line {}: '{}' is not {}", file_.string(), entry.line,
                          io::quote(fmt::format("{} {}", entry.name, entry.value)), expected));
}

std::optional<std::string> CommandEntries::text(std::string_view name) {
  const io::CommandEntry* entry = find(name);
  if (entry == nullptr) return std::nullopt;
  if (entry->value.empty()) fail(*entry, "an entry with a value");
  return entry->value;
}

std::optional<fs::path> CommandEntries::path(std::string_view name) {
  const auto value = text(name);
  if (!value) return std::nullopt;
  const fs::path folder = file_.parent_path();
  const std::array places{folder, folder / ".."};
  auto found = io::find_named_file(*value, places);
  if (!found) found = io::find_named_file(io::without_folders(*value), places);
  return found.value_or(folder / *value);
}

std::optional<std::vector<double>> CommandEntries::numbers(std::string_view name,
                                                           std::size_t fewest, std::size_t most,
                                                           std::span<const double> defaults) {
  const io::CommandEntry* entry = find(name);
  if (entry == nullptr) return std::nullopt;
  const auto words = split_list(entry->value);
  if (std::ranges::none_of(words, [](const auto& word) { return word.has_value(); }))
    return std::nullopt;
  std::vector<double> values(defaults.begin(), defaults.end());
  values.resize(std::max(values.size(), words.size()));
  for (std::size_t i = 0; i < words.size(); ++i) {
    if (!words[i] && i < defaults.size()) continue;
    const auto value =
        words[i] ? io::parse_number(*words[i], base::kLargestPosition_px) : std::nullopt;
    if (!value)
      fail(*entry, fmt::format("a number from -{0:g} to {0:g}", base::kLargestPosition_px));
    values[i] = *value;
  }
  if (values.size() < fewest || values.size() > most) {
    fail(*entry, fewest == most ? fmt::format("an entry of {} numbers", most)
                                : fmt::format("an entry of {} to {} numbers", fewest, most));
  }
  return values;
}

std::optional<std::vector<double>> CommandEntries::sizes(std::string_view name) {
  auto found = numbers(name, 2, 2);
  if (found && !(found->at(0) > 0 && found->at(1) > 0))
    fail(*find(name), fmt::format("a width and a height above 0: correct it, or go on with "
                                  "--ignore {}",
                                  name));
  return found;
}

std::optional<double> CommandEntries::number(std::string_view name) {
  const auto values = numbers(name, 1, 1);
  return values ? std::optional(values->front()) : std::nullopt;
}

std::vector<std::string> CommandEntries::texts(std::string_view name) {
  const std::string wanted = upper_case(name);
  known_.insert(wanted);
  std::vector<std::string> values;
  for (const io::CommandEntry& entry : command_.entries)
    if (upper_case(entry.name) == wanted && !project_.ignores(name)) values.push_back(entry.value);
  return values;
}

std::optional<std::string> CommandEntries::fault_of(std::string_view name, std::string_view why) {
  const io::CommandEntry* entry = find(name);
  if (entry == nullptr) return std::nullopt;
  return fmt::format("line {}: {} {}", entry->line, entry->name, why);
}

void CommandEntries::know(std::span<const std::string_view> names) {
  for (const std::string_view name : names) known_.insert(upper_case(name));
}

void CommandEntries::warn_about_others() {
  for (const io::CommandEntry& entry : command_.entries) {
    if (!known_.insert(upper_case(entry.name)).second || project_.ignores(entry.name)) continue;
    project_.warn(
        fmt::format("'{}', line {}: {} is not known to this program and has no effect "
                    "(--ignore {} says that this is meant)",
                    file_.string(), entry.line, io::quote(entry.name), io::quote(entry.name)));
  }
}

}  // namespace tomofield::projects
