#include "cli/console.h"
#include "cli/program.h"
#include "distributed/communicator.h"
#include "tomofield/error.h"

int main(int argc, char** argv) {
  tomofield::cli::open_console();
  try {
    const tomofield::distributed::Session session;
    return tomofield::cli::run_program(argc, argv, session);
  } catch (const tomofield::Error& error) {  // a fault of the session; the program reports its own
    tomofield::cli::say("tomofield: {}\n", error.what());
    return 2;
  }
}
