#include "base/system/program_path.h"

#include <cstdlib>

namespace tomofield::base {

std::filesystem::path program_path() {
  if (const char* launcher = std::getenv("TOMOFIELD_LAUNCHER")) return launcher;
  return std::filesystem::read_symlink("/proc/self/exe");
}

}  // namespace tomofield::base
