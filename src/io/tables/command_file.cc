#include "io/tables/command_file.h"

#include <fmt/format.h>

#include <string_view>
#include <utility>

#include "io/tables/text_lines.h"
#include "tomofield/error.h"

namespace tomofield::io {
namespace {

// Splits a line into its first word and the rest.
std::pair<std::string_view, std::string_view> split_first_word(std::string_view text) {
  const auto words = split_words(text);
  if (words.empty()) return {};
  const std::string_view rest = text.substr(
      static_cast<std::size_t>(words.front().data() - text.data()) + words.front().size());
  return {words.front(), trim(rest)};
}

}  // namespace

std::vector<Command> read_command_file(const std::filesystem::path& path) {
  std::vector<Command> commands;
  for (const TextLine& line : read_text_lines(path)) {
    if (line.text.starts_with('#')) continue;
    if (line.text.starts_with('$')) {
      const auto [program, arguments] = split_first_word(std::string_view(line.text).substr(1));
      commands.push_back({std::string(program.substr(program.rfind('/') + 1)),
                          std::string(arguments),
                          line.number,
                          {}});
    } else if (!commands.empty()) {
      const auto [name, value] = split_first_word(line.text);
      commands.back().entries.push_back({std::string(name), std::string(value), line.number});
    }
  }
  if (commands.empty()) {
    throw Error(fmt::format("'{}' has no command ($tilt and so on): is it a command file of IMOD?",
                            path.string()));
  }
  return commands;
}

}  // namespace tomofield::io
