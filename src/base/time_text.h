#pragma once

#include <string>

namespace tomofield::base {

/// Returns a duration as "2 h 05 min", "3 min 20 s" or "12 s".
std::string time_text(double seconds);

}  // namespace tomofield::base
