#include "compare/rehearsal.h"

#include <fmt/format.h>
#include <stdlib.h>

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <fstream>
#include <iterator>
#include <optional>
#include <string>
#include <system_error>

#include "compare/child_process.h"
#include "compare/grid.h"
#include "tomofield/error.h"

namespace tomofield::compare {
namespace {

namespace fs = std::filesystem;

// Makes a directory where a folder is, or will be made. Removes it with all its contents.
class ScratchFolder {
 public:
  explicit ScratchFolder(const fs::path& folder) {
    fs::path place = fs::absolute(folder);
    while (!fs::exists(place)) place = place.parent_path();
    std::string name = (place / ".tomofield-compare-XXXXXX").string();
    if (!fs::is_directory(place) || mkdtemp(name.data()) == nullptr) {
      throw Error(
          fmt::format("the folder '{}' cannot be made or written: '{}' {}: give another "
                      "with -o",
                      folder.string(), place.string(),
                      fs::is_directory(place) ? std::strerror(errno) : "is no folder"));
    }
    path_ = name;
  }
  ~ScratchFolder() {
    std::error_code ignored;
    fs::remove_all(path_, ignored);
  }
  ScratchFolder(const ScratchFolder&) = delete;
  ScratchFolder& operator=(const ScratchFolder&) = delete;
  const fs::path& path() const { return path_; }

 private:
  fs::path path_;
};

std::string text_of(const fs::path& file) {
  std::ifstream stream(file);
  return {std::istreambuf_iterator<char>(stream), {}};
}

// Returns the grid of the row's future volume, or nothing if it was asked to stop.
std::optional<Grid> grid_to_be(const CompareOptions& options, const RunHooks& hooks, const Row& row,
                               const fs::path& scratch) {
  if (is_done(row)) return read_grid(row.volume);
  const fs::path log = scratch / "log";
  // The volume lies in the folder if that exists, so that the check finds a result that would
  // replace an input.
  const bool has_folder = fs::is_directory(options.folder);
  auto command =
      full_command(options.program, row, has_folder ? row.volume : scratch / row.volume.filename());
  command.emplace_back("--dry-run");
  const ChildResult result = run_child(command, log, hooks.stop_requested);
  if (hooks.must_stop()) return std::nullopt;
  if (result.exit_status != 0)
    throw Error(fmt::format("{}: {}", row.run.name, reason_of_failure(log)));
  return planned_grid(text_of(log));
}

void require_not_replaced(const fs::path& truth, const Row& row) {
  std::error_code absent;
  if (!fs::equivalent(truth, row.volume, absent)) return;
  throw Error(fmt::format("{} would replace the truth '{}': give another folder with -o",
                          row.run.name, truth.string()));
}

}  // namespace

bool rehearse(const CompareOptions& options, const RunHooks& hooks, const std::vector<Row>& rows) {
  const ScratchFolder scratch(options.folder);
  std::optional<NamedGrid> main;
  for (const Row& row : rows) {
    if (options.truth) require_not_replaced(*options.truth, row);
    const std::optional<Grid> grid = grid_to_be(options, hooks, row, scratch.path());
    if (!grid) return false;
    if (!main) {
      main = {row.run.name, *grid};
      const bool is_a_part =
          std::ranges::find(options.series_words, "--roi") != options.series_words.end();
      if (options.truth) require_truth_fits(*options.truth, *main, is_a_part);
    }
    require_one_grid(*main, {row.run.name, *grid});
  }
  return true;
}

}  // namespace tomofield::compare
