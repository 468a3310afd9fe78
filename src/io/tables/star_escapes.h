#pragma once

#include <string>
#include <string_view>

namespace tomofield::io {

/// Prepares a STAR file for a parser of CIF, whose words are printable ASCII and begin with no sign
/// of its grammar. RELION writes every word without blanks as it is (escapeStringForSTAR() in
/// metadata_table.cpp): "TS_Müller", "data_01". Writes bytes beyond ASCII, and the first byte of a
/// value that would be a head of CIF, as "~%" and two hexadecimal digits. Ends lines by "\n".
std::string escaped_star(std::string_view text);

/// Returns a word of such a text as it was.
std::string unescaped_star(std::string_view word);

}  // namespace tomofield::io
