#pragma once

#include <string>

namespace tomofield::bench {

/// "AMD EPYC 7763", from /proc/cpuinfo; empty where there is none.
std::string cpu_model();

/// `git describe` of the sources that this program was built from; empty without git.
std::string source_commit();

}  // namespace tomofield::bench
