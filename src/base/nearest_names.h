#pragma once

#include <string>
#include <vector>

namespace tomofield::base {

/// Returns the names that somebody who wrote an unknown one may have meant: those with the fewest
/// other letters, if these are few, or else those that share words with it ("tv" and "tv-weight",
/// "margin" and "with_margin", "thick" and "thickness"), the shortest first. It is empty if none is
/// alike, or too many are.
std::vector<std::string> nearest_names(const std::string& unknown,
                                       const std::vector<std::string>& names);

/// Returns " (did you mean a or b?)", the end of a sentence on an unknown name, or an empty text
/// without names.
std::string did_you_mean(const std::vector<std::string>& nearest);

}  // namespace tomofield::base
