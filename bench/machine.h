#pragma once

#include <string>

namespace tomofield::bench {

/// "AMD EPYC 7763", from /proc/cpuinfo; empty where there is none.
std::string cpu_model();

}  // namespace tomofield::bench
