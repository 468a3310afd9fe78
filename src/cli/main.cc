#include "cli/program.h"

int main(int argc, char** argv) { return tomofield::cli::run_program(argc, argv); }
