#pragma once

#include <stdexcept>
#include <string>
#include <vector>

namespace tomofield::base {

[[noreturn]] inline void check_failed(const char* condition, const char* file, int line,
                                      const std::string& context) {
  throw std::logic_error(std::string(file) + ":" + std::to_string(line) + ": '" + condition +
                         "' does not hold: " + context);
}

/// Throws Error with all the faults of the user's input, if there are any.
void require_no_faults(const std::vector<std::string>& faults);

}  // namespace tomofield::base

/// Guards an invariant of the program and throws std::logic_error if it does not hold. The user's
/// input is checked with tomofield::Error instead. `context` is evaluated on failure only and says
/// what a maintainer needs.
#define TOMOFIELD_CHECK(condition, context)                                                     \
  do {                                                                                          \
    if (!(condition)) ::tomofield::base::check_failed(#condition, __FILE__, __LINE__, context); \
  } while (false)
