#pragma once

#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "io/tables/star_file.h"

namespace tomofield::io {

/// Return the columns of RELION's tables of tomograms, and of views with their optics, that this
/// program uses, or that make no difference to its results.
std::span<const std::string_view> known_tomogram_columns();
std::span<const std::string_view> known_view_columns();

/// Tells whether an entry states something other than zeros, such as a number or "nan".
bool is_not_zero(const std::string& text);

/// Returns the columns of a table that state something and are not among the known ones, with an
/// underscore. Names are the same in upper and lower case.
std::vector<std::string> unknown_columns(const StarTable& table,
                                         std::span<const std::string_view> known);

/// Returns a sentence, without the file, that names the entries of a file which this program does
/// not know: nothing that a file states is dropped in silence. Returns nothing if there are none.
std::optional<std::string> remark_on_unknown(std::span<const std::string> entries);

}  // namespace tomofield::io
