// Prints docs/options.md, which is made from the table of options (src/option_table/rows.cc):
//
//   options_markdown > docs/options.md
//   options_markdown --check docs/options.md   exits with 1 if the file has another text
#include <cstdio>
#include <fstream>
#include <iterator>
#include <string>

#include "option_table/documentation.h"

int main(int argc, char** argv) {
  const std::string page = tomofield::option_table::options_markdown();
  if (argc == 1) return std::fputs(page.c_str(), stdout) < 0 ? 1 : 0;
  if (argc != 3 || std::string(argv[1]) != "--check") return 2;
  std::ifstream file(argv[2]);
  if (std::string(std::istreambuf_iterator<char>(file), {}) == page) return 0;
  std::fprintf(stderr, "%s is not what the table says: run %s > %s\n", argv[2], argv[0], argv[2]);
  return 1;
}
