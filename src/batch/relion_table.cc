#include "batch/relion_table.h"

#include <fmt/format.h>

#include <algorithm>
#include <map>
#include <optional>
#include <set>
#include <string>

#include "base/log.h"
#include "exchange/relion_output.h"
#include "io/is_file.h"
#include "io/saving/atomic_file.h"
#include "io/saving/output_set.h"
#include "io/tables/star_file.h"
#include "tomofield/error.h"

namespace tomofield::batch {

namespace fs = std::filesystem;
namespace {

constexpr const char* kName = "rlnTomoName";
constexpr const char* kTomogram = "rlnTomoReconstructedTomogram";
constexpr const char* kDenoised = "rlnTomoReconstructedTomogramDenoised";

// Adds the one row of a table to another table, whose columns may differ.
void add_row(const io::StarTable& row, io::StarTable& all) {
  std::vector<std::string> cells;
  for (const std::string& column : all.columns())
    cells.push_back(row.find(0, column).value_or("None"));
  all.add_row(std::move(cells));
  for (const std::string& column : row.columns())
    if (!all.has_column(column)) all.set(all.num_rows() - 1, column, *row.find(0, column));
}

// Returns the rows beside the results of jobs as one table, or nothing if there are none, or two of
// the same name.
std::optional<io::StarTable> rows_of(const std::vector<Job>& jobs) {
  std::optional<io::StarTable> all;
  std::set<std::string> names;
  for (const Job& job : jobs) {
    const auto row = exchange::read_relion_output(job.output);
    if (!row) continue;
    if (!names.insert(row->find(0, kName).value_or("")).second) return std::nullopt;
    if (all)
      add_row(*row, *all);
    else
      all = row;
  }
  return all;
}

// Returns the names of the files of the volumes in a table of a batch, or none for any other file.
std::set<std::string> volumes_of(const fs::path& file) {
  std::set<std::string> volumes;
  if (!io::is_file(file)) return volumes;
  try {
    const std::vector<io::StarTable> tables = io::read_star_file(file);
    if (tables.size() != 1) return {};
    const io::StarTable& table = tables.front();
    for (std::size_t row = 0; row < table.num_rows(); ++row) {
      const auto volume = table.find(row, kTomogram);
      if (!volume || table.find(row, kDenoised) != volume) return {};
      volumes.insert(fs::path(*volume).filename());
    }
    return volumes;
  } catch (const Error&) {
    return {};
  }
}

}  // namespace

fs::path relion_table(const fs::path& folder) { return folder / "tomograms.star"; }

bool has_relion_table(const fs::path& folder) { return !volumes_of(relion_table(folder)).empty(); }

std::string tomogram_of_result(const Job& job) {
  const auto row = exchange::read_relion_output(job.output);
  return row ? row->find(0, kName).value_or("") : "";
}

void warn_of_equal_tomograms(const std::vector<Job>& jobs) {
  std::map<std::string, const Job*> named;
  for (const Job& job : jobs) {
    const std::string& name = job.files.relion_tomogram;
    if (name.empty()) continue;
    const auto [first, is_new] = named.emplace(name, &job);
    if (is_new) continue;
    base::log_warning(
        fmt::format("the series '{}' and '{}' are both called '{}' in their tables of RELION, "
                    "which needs names that differ: no tomograms.star of all series is written",
                    first->second->name, job.name, name));
    return;
  }
}

void write_relion_table(const fs::path& folder, const std::vector<Job>& all,
                        const std::vector<Job>& finished) {
  const fs::path file = relion_table(folder);
  if (const auto rows = rows_of(finished)) {
    io::write_text_file(file, io::star_file_text(*rows));
    return;
  }
  const std::set<std::string> volumes = volumes_of(file);
  const bool is_old = std::ranges::any_of(
      all, [&](const Job& job) { return volumes.contains(job.output.filename()); });
  if (io::OutputSet* const results = io::OutputSet::active(); results != nullptr && is_old)
    results->remove_old(file);
}

}  // namespace tomofield::batch
