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

}  // namespace tomofield::base
