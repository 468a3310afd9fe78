// Prints docs/options.md. A unit test checks that the committed page is the same.
#include <cstdio>

#include "option_table/documentation.h"

int main() { std::fputs(tomofield::option_table::options_markdown().c_str(), stdout); }
