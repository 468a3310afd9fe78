#include "batch/relion_table.h"

#include <algorithm>
#include <optional>
#include <string>

#include "exchange/relion_output.h"
#include "io/saving/atomic_file.h"
#include "io/saving/output_set.h"
#include "io/tables/star_file.h"

namespace tomofield::batch {

namespace fs = std::filesystem;
namespace {

// Adds the one row of a table to another table, whose columns may differ.
void add_row(const io::StarTable& row, io::StarTable& all) {
  std::vector<std::string> cells;
  for (const std::string& column : all.columns())
    cells.push_back(row.find(0, column).value_or("None"));
  all.add_row(std::move(cells));
  for (const std::string& column : row.columns())
    if (!all.has_column(column)) all.set(all.num_rows() - 1, column, *row.find(0, column));
}

}  // namespace

fs::path relion_table(const fs::path& folder) { return folder / "tomograms.star"; }

bool are_of_star_files(const std::vector<Job>& jobs) {
  // The word that is no option is the path that `reconstruct` takes.
  const auto names_star = [](const std::string& word) {
    return !word.starts_with('-') && word.ends_with(".star");
  };
  return std::ranges::any_of(
      jobs, [&](const Job& job) { return std::ranges::any_of(job.command, names_star); });
}

void write_relion_table(const fs::path& folder, const std::vector<Job>& finished) {
  std::optional<io::StarTable> all;
  for (const Job& job : finished) {
    const auto row = exchange::read_relion_output(job.output);
    if (row && all)
      add_row(*row, *all);
    else if (row)
      all = row;
  }
  if (all)
    io::write_text_file(relion_table(folder), io::star_file_text(*all));
  else if (io::OutputSet* const results = io::OutputSet::active())
    results->remove_old(relion_table(folder));
}

}  // namespace tomofield::batch
