#pragma once

#include <string>
#include <vector>

namespace tomofield::base {

/// Throws Error with all the faults, if there are any.
void require_no_faults(const std::vector<std::string>& faults);

}  // namespace tomofield::base
