#include "cli/common_options.h"

#include <string>

#include "base/parallel.h"
#include "cli/number_checks.h"

namespace tomofield::cli {

void add_common_options(CLI::App& command) {
  const char* group = "Running";
  constexpr int kMaxThreads = 1024;
  command
      .add_option_function<int>("--threads", base::set_thread_count,
                                "number of threads; default: OMP_NUM_THREADS, or every core. The "
                                "result is the same for any "
                                "number")
      ->check(number_between(1, kMaxThreads))
      ->type_name("INT")
      ->group(group);
  command
      .add_option_function<std::string>(
          "--config", [](const std::string&) {},
          "read options from a TOML file, such as thickness = 150; the command line wins")
      ->type_name("FILE.toml")
      ->group(group);
}

}  // namespace tomofield::cli
