#pragma once

#include <string>
#include <vector>

namespace tomofield::io {

/// A table as a STAR file has it. Names of columns have no leading underscore.
struct ParsedTable {
  std::string name;
  std::vector<std::string> columns;
  std::vector<std::vector<std::string>> rows;
};

/// Parses the text of a STAR file: a table for each loop, and one for the single values of a data
/// block. Throws std::runtime_error, with the line, for a text that is none.
std::vector<ParsedTable> parse_star(const std::string& text);

}  // namespace tomofield::io
