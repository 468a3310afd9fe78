#include "base/check.h"
#include "fit/integer_program.h"

// Stands in for integer_program.cc in a build without COIN-OR CBC (TOMOFIELD_WITH_CBC=OFF).
namespace tomofield::fit {

bool can_solve_integer_programs() { return false; }

std::vector<bool> solve(const IntegerProgram&) {
  TOMOFIELD_CHECK(can_solve_integer_programs(), "options refuse --tree adaptive without CBC");
  return {};
}

}  // namespace tomofield::fit
