#include "cli/program.h"
#include "cli/terminal/console.h"
#include "distributed/communicator.h"
#include "tomofield/error.h"

#if defined(__GLIBC__)
#include <malloc.h>
#endif

namespace {

// Lets the allocator keep some memory that is freed. Images of views are made and freed thousands
// of times in an alignment, and it costs a tenth of the time to get them from the system each time.
void keep_freed_memory() {
#if defined(__GLIBC__)
  constexpr int kLargestKept = 1 << 20, kMostKept = 16 << 20;  // bytes: of a block, of all
  mallopt(M_MMAP_THRESHOLD, kLargestKept);
  mallopt(M_TRIM_THRESHOLD, kMostKept);
#endif
}

}  // namespace

int main(int argc, char** argv) {
  keep_freed_memory();
  tomofield::cli::open_console();
  try {
    const tomofield::distributed::Session session;
    return tomofield::cli::run_program(argc, argv, session);
  } catch (const tomofield::Error& error) {  // a fault of the session; the program reports its own
    tomofield::cli::say("tomofield: {}\n", error.what());
    return 2;
  }
}
