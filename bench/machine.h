#pragma once

#include <string>

namespace tomofield::bench {

/// Returns the name of the processor from /proc/cpuinfo, as "AMD EPYC 7763", or an empty string.
std::string cpu_model();

}  // namespace tomofield::bench
