#pragma once

#include <string>
#include <string_view>

namespace tomofield::base {

/// Returns text as UTF-8: every byte that is no part of a valid character becomes \xHH, with its
/// value in hexadecimal. Names of files may have any bytes; JSON, HTML and HDF5 texts may not.
std::string utf8_text(std::string_view bytes);

/// Returns UTF-8 text that a terminal shows and does not obey: control characters (C0, DEL, C1)
/// become \xHH too.
std::string printable(std::string_view bytes);

}  // namespace tomofield::base
