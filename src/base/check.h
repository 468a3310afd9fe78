#pragma once

#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include "tomofield/error.h"

namespace tomofield::base {

[[noreturn]] inline void check_failed(const char* condition, const char* file, int line,
                                      const std::string& context) {
  throw std::logic_error(std::string(file) + ":" + std::to_string(line) + ": '" + condition +
                         "' does not hold: " + context);
}

/// Collects the faults of the user's input, so that they are seen at once.
class Faults {
 public:
  void add(std::string sentence) { sentences_.push_back(std::move(sentence)); }
  void add_if(bool is_fault, const char* sentence) {
    if (is_fault) add(sentence);
  }
  /// Adds what `check` throws as Error, behind `prefix`.
  template <typename Check>
  void collect(const Check& check, const char* prefix = "") {
    try {
      check();
    } catch (const Error& error) {
      add(std::string(prefix) + error.what());
    }
  }
  const std::vector<std::string>& sentences() const { return sentences_; }

 private:
  std::vector<std::string> sentences_;
};

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
