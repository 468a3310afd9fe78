#pragma once

#include <string>
#include <string_view>
#include <vector>

namespace tomofield::option_table {

/// Returns the names in the list of an option such as --ignore, "LOCALFILE, LOG", without the empty
/// ones.
std::vector<std::string> split_names(std::string_view list);

/// Returns true if a name is among others, in upper or lower case.
bool has_name(const std::vector<std::string>& names, std::string_view name);

}  // namespace tomofield::option_table
