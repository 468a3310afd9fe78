#include <cstdio>

#include "cli/program.h"
#include "distributed/communicator.h"
#include "tomofield/error.h"

int main(int argc, char** argv) {
  try {
    const tomofield::distributed::Session session;
    return tomofield::cli::run_program(argc, argv, session);
  } catch (const tomofield::Error& error) {  // a fault of the session; the program reports its own
    std::fprintf(stderr, "tomofield: %s\n", error.what());
    return 2;
  }
}
