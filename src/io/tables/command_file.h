#pragma once

#include <filesystem>
#include <string>
#include <vector>

namespace tomofield::io {

/// One entry that a command reads from the lines below it: `THICKNESS 1200`.
struct CommandEntry {
  std::string name;
  std::string value;  ///< without white space at its ends; empty for a switch
  int line = 0;
};

/// One command of an IMOD command file: the line `$tilt -StandardInput` and the entries below it.
struct Command {
  std::string program;    ///< without its folder: "tilt"
  std::string arguments;  ///< "-StandardInput"
  int line = 0;
  std::vector<CommandEntry> entries;
};

/// Reads an IMOD command file (.com). Comments begin with '#'. Lines before the first command are
/// skipped. Throws Error if the file is no text, or has no command.
std::vector<Command> read_command_file(const std::filesystem::path& path);

}  // namespace tomofield::io
