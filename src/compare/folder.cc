#include "compare/folder.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <filesystem>
#include <iterator>
#include <string>

#include "base/log.h"
#include "compare/pictures.h"
#include "io/saving/output_files.h"
#include "io/saving/output_target.h"
#include "tomofield/error.h"

namespace tomofield::compare {
namespace {

namespace fs = std::filesystem;

// Returns the files of the report and its pictures (pictures.h).
std::vector<fs::path> report_files(const CompareOptions& options) {
  std::vector<fs::path> files;
  for (const char* name : {"report.html", "comparison.json", "comparison.csv", "profile.csv"})
    files.push_back(options.folder / name);
  std::vector<std::string> shown = names_of(options.methods);
  shown.emplace_back("truth");
  for (const std::string& name : shown) {
    for (const char* part : kPictureParts)
      files.push_back(picture_path(options.folder / "pictures", name, part));
  }
  return files;
}

void require_new(const std::vector<fs::path>& files) {
  for (const fs::path& file : files) {
    if (!fs::exists(fs::symlink_status(file))) continue;
    throw Error(
        fmt::format("'{}' exists, and this comparison has not made it: give another folder with "
                    "-o, or --overwrite to replace it",
                    file.string()));
  }
}

// Returns every file that the comparison or one of its runs reads.
std::vector<fs::path> inputs_of(const CompareOptions& options, const std::vector<Row>& rows) {
  std::vector<fs::path> inputs;
  if (options.truth) inputs.push_back(*options.truth);
  for (const Row& row : rows) std::ranges::copy(row.run.inputs, std::back_inserter(inputs));
  return inputs;
}

bool is_new(const Row& row) { return row.state.progress == Progress::kNone; }

}  // namespace

void check_folder(const CompareOptions& options, const std::vector<Row>& rows) {
  const std::vector<fs::path> inputs = inputs_of(options, rows);
  std::vector<fs::path> results = report_files(options);
  for (const Row& row : rows) std::ranges::copy(files_of(row), std::back_inserter(results));
  io::require_no_input_is_replaced(results, inputs);
  io::require_distinct(results);
  for (const fs::path& file : results) io::output_target(file);  // throws for what is no file
  const fs::path pictures = options.folder / "pictures";
  if (fs::exists(pictures) && !fs::is_directory(pictures))
    throw Error(
        fmt::format("'{}' must be a folder: give another folder with -o", pictures.string()));
  if (options.overwrite) return;
  for (const Row& row : rows)
    if (is_new(row)) require_new(files_of(row));
  if (std::ranges::all_of(rows, is_new)) require_new(report_files(options));
}

void check_planned_files(const CompareOptions& options, const std::vector<Row>& rows,
                         const Row& row, const std::vector<fs::path>& files) {
  io::require_no_input_is_replaced(files, inputs_of(options, rows));
  if (!options.overwrite && is_new(row)) require_new(files);
}

void remove_results(const CompareOptions& options, const std::vector<Row>& rows) {
  for (const fs::path& file : report_files(options)) fs::remove(file);
  for (const Row& row : rows) {
    std::vector<fs::path> files = files_of(row);
    std::ranges::reverse(files);  // the row goes last: it says whose the others are
    for (const fs::path& file : files) fs::remove(file);
  }
}

void warn_of_other_runs(const CompareOptions& options, const std::vector<Row>& rows) {
  std::vector<std::string> others;
  for (const fs::directory_entry& entry : fs::directory_iterator(options.folder)) {
    const std::string name = run_of_state(entry.path());
    const auto has_name = [&](const Row& row) { return row.volume.stem() == name; };
    if (!name.empty() && std::ranges::none_of(rows, has_name)) others.push_back(name);
  }
  if (others.empty()) return;
  std::ranges::sort(others);
  base::log_warning(
      fmt::format("'{}' also has what an older comparison made: {}. These files stay, and the new "
                  "report has nothing of them",
                  options.folder.string(), fmt::join(others, ", ")));
}

}  // namespace tomofield::compare
