#pragma once

#include <string>
#include <string_view>
#include <vector>

namespace tomofield::batch {

/// One record of a table of text.
struct CsvRecord {
  int line = 0;  ///< on which it begins, from 1
  std::vector<std::string> fields;
};

/// Parses comma-separated values by RFC 4180, or values separated by tabs. A field in double quotes
/// may have separators, line ends and doubled quotes. Other fields lose white space at their ends.
/// Accepts either kind of line end, and skips a byte order mark and lines without any text. Throws
/// Error, with the line, for a quote that is not closed and for text after a closing quote.
std::vector<CsvRecord> parse_csv(std::string_view text, char separator);

/// Returns a text with an apostrophe before it if a spreadsheet would take it for a formula and run
/// it: if it begins with =, +, -, @ or a control character (OWASP, CSV Injection).
std::string spreadsheet_text(std::string_view text);

/// Returns a field as parse_csv() reads it, in quotes if it needs them.
std::string csv_field(std::string_view text);

}  // namespace tomofield::batch
