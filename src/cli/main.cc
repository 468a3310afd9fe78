#include "cli/program.h"
#include "distributed/communicator.h"

int main(int argc, char** argv) {
  const tomofield::distributed::Session session;
  return tomofield::cli::run_program(argc, argv, session);
}
