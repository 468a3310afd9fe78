#include "cli/options/common_options.h"

#include <fmt/format.h>
#include <fmt/ranges.h>
#include <algorithm>
#include <string>

#include "base/threads/parallel.h"
#include "cli/options/number_checks.h"
#include "io/saving/output_files.h"
#include "tomofield/error.h"

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

std::vector<option_table::GivenOption> given_options(const CLI::App& command,
                                                     const std::vector<std::string>& except) {
  std::vector<option_table::GivenOption> given;
  for (const CLI::Option* option : command.get_options()) {
    if (option->count() == 0 || std::ranges::count(except, option->get_name()) > 0) continue;
    option_table::GivenOption& added = given.emplace_back();
    if (!option->get_positional() || !option->get_lnames().empty()) added.flag = option->get_name();
    if (option->get_items_expected_max() > 0)
      added.value = fmt::format("{}", fmt::join(option->results(), ","));
  }
  return given;
}

namespace {

// Refuses a file within a result that is a folder, such as an OME-Zarr.
void require_outside_results(const std::filesystem::path& file,
                             const std::vector<std::filesystem::path>& results) {
  std::error_code unknown;
  const auto place = std::filesystem::weakly_canonical(file, unknown).string();
  for (const std::filesystem::path& result : results) {
    const auto folder = std::filesystem::weakly_canonical(result, unknown).string() + "/";
    if (place.starts_with(folder))
      throw Error(fmt::format("'{}' would lie in the result '{}': give another name", file.string(),
                              result.string()));
  }
}

}  // namespace

void check_extra_files(std::initializer_list<ExtraFile> files,
                       const std::vector<std::filesystem::path>& results, const SeriesFiles& input,
                       const RunOptions& run) {
  std::vector<std::filesystem::path> all = results;
  for (const auto& [file, flag] : files) {
    if (!file) continue;
    io::check_output_files({*file}, io::input_files(input), run.overwrite,
                           fmt::format("give another name with {}{}", flag,
                                       run.resume ? "" : ", or --overwrite to replace it"));
    require_outside_results(*file, results);
    all.push_back(*file);
    io::require_distinct(all);
  }
}

const CLI::App* find_command(const CLI::App& program, const std::vector<std::string>& arguments) {
  const CLI::App* command = &program;
  for (const std::string& word : arguments) {
    const auto named =
        command->get_subcommands([&](const CLI::App* sub) { return sub->get_name() == word; });
    if (named.empty()) break;
    command = named.front();
  }
  return command;
}

std::string full_name(const CLI::App& command) {
  const CLI::App* parent = command.get_parent();
  return parent == nullptr ? "tomofield" : full_name(*parent) + " " + command.get_name();
}

bool is_given(const CLI::Option& option, const std::vector<std::string>& arguments) {
  return std::any_of(arguments.begin(), arguments.end(), [&](const std::string& argument) {
    const std::string name = argument.substr(0, argument.find('='));
    return name.rfind('-', 0) == 0 && option.check_name(name);
  });
}

}  // namespace tomofield::cli
