#include "batch/relion_table.h"

#include <fmt/format.h>

#include <algorithm>
#include <map>
#include <optional>
#include <set>
#include <string>
#include <string_view>
#include <system_error>
#include <vector>

#include "base/log.h"
#include "exchange/relion_output.h"
#include "io/file_start.h"
#include "io/saving/atomic_file.h"
#include "io/saving/output_set.h"
#include "io/tables/star_file.h"
#include "tomofield/error.h"

namespace tomofield::batch {

namespace fs = std::filesystem;
namespace {

constexpr const char* kName = "rlnTomoName";
constexpr const char* kTomogram = "rlnTomoReconstructedTomogram";
// The first line of the table, which tells it from those of others.
constexpr std::string_view kMark = "# tomograms of a batch of tomofield\n";

// Adds the one row of a table to another table, whose columns may differ.
void add_row(const io::StarTable& row, io::StarTable& all) {
  std::vector<std::string> cells;
  for (const std::string& column : all.columns())
    cells.push_back(row.find(0, column).value_or("None"));
  all.add_row(std::move(cells));
  for (const std::string& column : row.columns())
    if (!all.has_column(column)) all.set(all.num_rows() - 1, column, *row.find(0, column));
}

// Returns the rows beside the results of jobs as one table, or nothing if there are none.
std::optional<io::StarTable> rows_of(const std::vector<Job>& jobs) {
  std::optional<io::StarTable> all;
  for (const Job& job : jobs) {
    const auto row = job.is_joined ? exchange::read_relion_output(job.output) : std::nullopt;
    if (row && all)
      add_row(*row, *all);
    else if (row)
      all = row;
  }
  return all;
}

// Returns the names of the files of the volumes in the table of a batch.
std::set<std::string> volumes_of(const fs::path& file) {
  std::set<std::string> volumes;
  try {
    for (const io::StarTable& table : io::read_star_file(file))
      for (std::size_t row = 0; row < table.num_rows(); ++row)
        volumes.insert(fs::path(table.find(row, kTomogram).value_or("")).filename());
  } catch (const Error&) {
    // There is none, or it is damaged.
  }
  return volumes;
}

// Returns RELION's table of a job, whatever its name in the command: that of a link, or the folder.
fs::path input_of(const Job& job) {
  if (job.command.size() < 2) return {};
  std::error_code failed;
  const fs::path input = job.command[1];
  const fs::path table = fs::is_directory(input, failed) ? input / "tomograms.star" : input;
  const fs::path file = fs::weakly_canonical(table, failed);
  return failed ? fs::absolute(table).lexically_normal() : file;
}

}  // namespace

fs::path relion_table(const fs::path& folder) { return folder / "tomograms.star"; }

bool has_relion_table(const fs::path& folder) {
  return io::begins_with(relion_table(folder), kMark);
}

std::string tomogram_of_result(const Job& job) {
  const auto row = exchange::read_relion_output(job.output);
  return row ? row->find(0, kName).value_or("") : "";
}

void join_rows(std::vector<Job>& jobs) {
  std::vector<Job*> with_row;
  for (Job& job : jobs)
    if (!job.files.relion_tomogram.empty()) with_row.push_back(&job);
  std::map<std::string, const Job*> named;
  for (const Job* const job : with_row) {
    const auto [first, is_new] = named.emplace(job->files.relion_tomogram, job);
    const bool is_of_other_table = input_of(*job) != input_of(*with_row.front());
    if (is_new && !is_of_other_table) continue;
    const Job& other = is_of_other_table ? *with_row.front() : *first->second;
    return base::log_warning(fmt::format(
        "the series '{}' and '{}' are {} of RELION, so no tomograms.star of all series is written: "
        "each has its own beside its tomogram",
        other.name, job->name,
        is_of_other_table ? "of two tables" : "both the tomogram '" + first->first + "'"));
  }
  for (Job* const job : with_row) job->is_joined = true;
}

void write_relion_table(const fs::path& folder, const std::vector<Job>& all,
                        const std::vector<Job>& finished) {
  const fs::path file = relion_table(folder);
  if (const auto rows = rows_of(finished)) {
    io::write_text_file(file, std::string(kMark) + io::star_file_text(*rows));
    return;
  }
  if (!has_relion_table(folder)) return;
  const std::set<std::string> volumes = volumes_of(file);
  const bool is_old = std::ranges::any_of(
      all, [&](const Job& job) { return volumes.contains(job.output.filename()); });
  if (io::OutputSet* const results = io::OutputSet::active(); results != nullptr && is_old)
    results->remove_old(file);
}

}  // namespace tomofield::batch
