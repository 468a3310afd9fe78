#include "cli/options/common_options.h"

#include <string>

#include "base/threads/parallel.h"
#include "cli/options/number_checks.h"

namespace tomofield::cli {

void add_common_options(CLI::App& command) {
  const char* group = "Running";
  command
      .add_option_function<int>("--threads", base::set_thread_count,
                                "Number of threads; the result is the same for any")
      ->check(number_between(1, base::kMostThreads))
      ->type_name("N")
      ->default_str("the processors that this process may use, or OMP_NUM_THREADS")
      ->group(group);
  command
      .add_option_function<std::string>(
          "--config", [](const std::string&) {},
          "Read options from a TOML file, such as thickness = 150")
      ->type_name("FILE.toml")
      ->group(group);
}

}  // namespace tomofield::cli
