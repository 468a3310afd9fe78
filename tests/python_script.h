#pragma once

#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <string>

#include "scratch_directory.h"

namespace tomofield::testing {

/// Returns true if Debian's Python has the modules that a test compares with.
inline bool python_has(const std::string& modules) {
  return std::system((TOMOFIELD_PYTHON " -c 'import " + modules + "' 2>/dev/null").c_str()) == 0;
}

/// Runs a Python script in `directory`. Returns all that it printed, with the message of a failed
/// assertion. Success without output is "".
inline std::string run_python(const ScratchDirectory& directory, const std::string& script) {
  const auto path = directory.write("script.py", script);
  const auto output = directory / "output.txt";
  const int status = std::system(
      ("cd '" + directory.path().string() + "' && " TOMOFIELD_PYTHON " script.py > output.txt 2>&1")
          .c_str());
  const std::string text = read_whole_file(output);
  return status != 0 && text.empty() ? "the script failed without a word" : text;
}

}  // namespace tomofield::testing
