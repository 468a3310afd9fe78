// Prints what is made from the table of options (src/option_table/rows.cc): docs/options.md, or
// with
// --python the types of the Python module.
//
//   options_markdown > docs/options.md
//   options_markdown --python > python/tomofield/options.py
//   options_markdown [--python] --check FILE   exits with 1 if the file has another text
#include <cstdio>
#include <fstream>
#include <iterator>
#include <string>
#include <vector>

#include "option_table/documentation.h"

int main(int argc, char** argv) {
  using namespace tomofield::option_table;
  std::vector<std::string> arguments(argv + 1, argv + argc);
  const bool is_python = !arguments.empty() && arguments.front() == "--python";
  if (is_python) arguments.erase(arguments.begin());
  const std::string text = is_python ? options_python() : options_markdown();
  if (arguments.empty()) return std::fputs(text.c_str(), stdout) < 0 ? 1 : 0;
  if (arguments.size() != 2 || arguments[0] != "--check") return 2;
  std::ifstream file(arguments[1]);
  if (std::string(std::istreambuf_iterator<char>(file), {}) == text) return 0;
  std::fprintf(stderr, "%s is not what the table says: run %s%s > %s\n", arguments[1].c_str(),
               argv[0], is_python ? " --python" : "", arguments[1].c_str());
  return 1;
}
