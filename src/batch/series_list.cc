#include "batch/series_list.h"

#include <fmt/format.h>
#include <fmt/ranges.h>
#include <glob.h>

#include <algorithm>
#include <cctype>
#include <map>
#include <optional>

#include "base/log.h"
#include "base/nearest_names.h"
#include "base/utf8.h"
#include "batch/csv.h"
#include "batch/placeholders.h"
#include "batch/relion_table.h"
#include "io/lower_extension.h"
#include "io/tables/relion_star.h"
#include "io/tables/text_lines.h"
#include "tomofield/error.h"

namespace tomofield::batch {
namespace {

namespace fs = std::filesystem;

struct Column {
  std::string name;
  ColumnKind kind = ColumnKind::kWithValue;  // of an option
  bool is(std::string_view wanted) const { return name == wanted; }
  bool is_input() const { return is("stack") || is("path"); }
  bool is_option() const { return !is_input() && !is("name") && !is("output"); }
};

std::string place(const fs::path& path, int line) {
  return fmt::format("line {} of '{}'", line, path.string());
}

// Returns a column's name as it must be spelled: "tilt-axis" for "--Tilt_Axis".
std::string usual_spelling(std::string_view name) {
  name.remove_prefix(std::min(name.find_first_not_of('-'), name.size()));
  std::string usual;
  for (const unsigned char c : name) usual += c == '_' ? '-' : static_cast<char>(std::tolower(c));
  return usual;
}

// Returns a sentence on a name that is neither a column nor an option.
std::string fault_of_unknown(const std::string& name, const KnownColumns& known) {
  const std::string usual = usual_spelling(name);
  if (!Column{.name = usual}.is_option() || known.kind_of("--" + usual) != ColumnKind::kUnknown)
    return fmt::format(
        "'{}' must be written '{}': columns have small letters, and options no dashes before them",
        name, usual);
  std::vector<std::string> names{"stack", "path", "name", "output"};
  names.insert(names.end(), known.names.begin(), known.names.end());
  std::vector<std::string> nearest = base::nearest_names(usual, names);
  for (std::string& column : nearest) column = fmt::format("'{}'", column);
  return fmt::format("'{}' is no option of `tomofield reconstruct`{}, which --help-all lists", name,
                     base::did_you_mean(nearest));
}

std::string fault_of(const Column& column, const KnownColumns& known) {
  switch (column.kind) {
    case ColumnKind::kUnknown:
      return fault_of_unknown(column.name, known);
    case ColumnKind::kNotHere:
      return fmt::format("'{}' is set by the batch and cannot be a column", column.name);
    case ColumnKind::kFlag:
    case ColumnKind::kWithValue:
      break;
  }
  return {};
}

// Throws Error if the head is one column because the table has another separator.
void require_separator(const fs::path& path, const CsvRecord& head) {
  if (head.fields.size() > 1) return;
  const std::string& name = head.fields.front();
  const bool has_tabs = name.find('\t') != std::string::npos;
  if (!has_tabs && name.find(';') == std::string::npos) return;
  throw Error(fmt::format("{}: its columns are separated by {}", place(path, head.line),
                          has_tabs
                              ? "tabs: give the table a name that ends with .tsv"
                              : "semicolons: save it with commas, or with tabs as a .tsv file"));
}

// Throws Error, also with what is wrong beside it, unless one column has the series.
void require_input(const fs::path& path, const CsvRecord& head, const std::vector<Column>& columns,
                   base::Faults& faults) {
  if (std::ranges::count_if(columns, &Column::is_input) == 1) return;
  const bool is_misspelt = std::ranges::any_of(columns, [](const Column& column) {
    return column.kind == ColumnKind::kUnknown &&
           Column{.name = usual_spelling(column.name)}.is_input();
  });
  if (!is_misspelt)
    faults.add(
        fmt::format("{}: one column must be named 'stack' (or 'path'), for the files of the series",
                    place(path, head.line)));
  require_none(faults);
}

// Returns the columns that the first record names.
std::vector<Column> read_head(const fs::path& path, const CsvRecord& head,
                              const KnownColumns& known, base::Faults& faults) {
  require_separator(path, head);
  std::vector<Column> columns;
  const auto fail = [&](const std::string& what) {
    faults.add(fmt::format("{}: {}", place(path, head.line), what));
  };
  for (const std::string& name : head.fields) {
    Column column{.name = name};
    if (name.empty()) {
      fail("a column has no name");
      column.kind = ColumnKind::kUnknown;
    } else if (std::ranges::count(head.fields, name) > 1 &&
               std::ranges::find(columns, name, &Column::name) == columns.end()) {
      fail(fmt::format("there are two columns '{}'", name));
    } else if (column.is_option()) {
      column.kind = known.kind_of("--" + name);
      if (const std::string fault = fault_of(column, known); !fault.empty()) fail(fault);
    }
    columns.push_back(column);
  }
  require_input(path, head, columns, faults);
  return columns;
}

// Returns whether a flag is given, or nothing if the cell cannot be read.
std::optional<bool> read_flag(std::string cell) {
  std::ranges::transform(cell, cell.begin(),
                         [](unsigned char c) { return static_cast<char>(std::tolower(c)); });
  if (cell == "true" || cell == "yes" || cell == "1") return true;
  if (cell == "false" || cell == "no" || cell == "0") return false;
  return std::nullopt;
}

// Adds the option of a cell that is not empty. Returns what is wrong, or an empty text. The head
// says what is wrong with a column.
std::string add_option(const Column& column, const std::string& cell, Series& series) {
  const std::string flag = "--" + column.name;
  if (column.kind == ColumnKind::kUnknown || column.kind == ColumnKind::kNotHere) return {};
  if (column.kind == ColumnKind::kWithValue) {
    series.options.push_back({flag, cell});
    return {};
  }
  const auto is_given = read_flag(cell);
  if (!is_given)
    return fmt::format("{} takes no value: the cell must be true, false or empty, not '{}'", flag,
                       io::quote(cell));
  if (*is_given)
    series.options.push_back({flag, std::nullopt});
  else
    series.left_out.push_back(flag);
  return {};
}

// Reads one series and adds its mistakes to `faults`.
Series read_row(const fs::path& path, const CsvRecord& record, const std::vector<Column>& columns,
                base::Faults& faults) {
  Series series{
      .name = {}, .source = place(path, record.line), .input = {}, .output = {}, .options = {}};
  const auto fail = [&](const std::string& what) { faults.add(series.source + ": " + what); };
  if (record.fields.size() != columns.size())
    fail(fmt::format("it has {} field{}, and there are {} columns", record.fields.size(),
                     record.fields.size() == 1 ? "" : "s", columns.size()));
  const std::size_t count = std::min(record.fields.size(), columns.size());
  for (std::size_t i = 0; i < count; ++i) {
    const std::string& cell = record.fields[i];
    const Column& column = columns[i];
    if (cell.empty()) continue;
    if (column.is_input()) {
      series.input = cell;
    } else if (column.is("name")) {
      series.name = cell;
    } else if (column.is("output")) {
      series.output = cell;
    } else if (const std::string fault = add_option(column, cell, series); !fault.empty()) {
      fail(fault);
    }
  }
  if (series.input.empty())
    fail("the series has no stack");
  else if (std::error_code absent; !fs::exists(series.input, absent))
    fail(fmt::format("'{}' does not exist", series.input.string()));
  if (series.name.empty())
    series.name = series_name(series.input);
  else
    faults.collect([&] {
      series.name = fill_placeholders(series.input, series.name, series.source + ", name");
    });
  return series;
}

// Puts the names of folders before names that several series have, from the inner to the outer
// ones, and before the name of the table for RELION.
void tell_apart(std::vector<Series>& all) {
  std::vector<fs::path> paths;
  for (const Series& series : all) {
    const fs::path path = fs::absolute(series.input).lexically_normal();
    paths.push_back(path.has_filename() ? path : path.parent_path());  // a slash at the end
  }
  for (bool has_changed = true; has_changed;) {
    has_changed = false;
    std::map<std::string, int> counts{{relion_table({}).stem(), 1}};
    for (const Series& series : all) ++counts[series.name];
    for (std::size_t i = 0; i < all.size(); ++i) {
      paths[i] = paths[i].parent_path();
      const std::string folder = paths[i].filename();
      if (counts[all[i].name] < 2 || folder.empty()) continue;
      all[i].name = folder + "_" + all[i].name;
      has_changed = true;
    }
  }
}

// Returns what names a series.
const char* advice_on_name(const Series& series) {
  return series.is_tomogram ? "give each tomogram an rlnTomoName of its own that can be a file's"
                            : "list the series in a table with a column 'name'";
}

}  // namespace

std::string series_name(const fs::path& input) {
  const fs::path path = input.has_filename() ? input : input.parent_path();  // a slash at the end
  std::error_code absent;
  return fs::is_directory(path, absent) ? path.filename().string() : path.stem().string();
}

std::vector<Series> read_table(const fs::path& path, const KnownColumns& known,
                               base::Faults& faults) {
  std::vector<CsvRecord> records;
  try {
    records = parse_csv(io::read_text_file(path), io::lower_extension(path) == ".tsv" ? '\t' : ',');
  } catch (const Error& error) {
    throw Error(fmt::format("the table '{}' cannot be read: {}", path.string(), error.what()));
  }
  if (records.size() < 2)
    throw Error(
        fmt::format("the table '{}' has no series: it needs a line that names its columns, "
                    "and a line for every series",
                    path.string()));
  const std::vector<Column> columns = read_head(path, records.front(), known, faults);
  std::vector<Series> all;
  for (auto record = records.begin() + 1; record != records.end(); ++record)
    all.push_back(read_row(path, *record, columns, faults));
  std::erase_if(all, [](const Series& series) { return series.input.empty(); });
  return all;
}

std::vector<Series> expand_pattern(const std::string& pattern) {
  glob_t found{};
  const int status = glob(pattern.c_str(), GLOB_TILDE, nullptr, &found);
  std::vector<Series> all;
  for (std::size_t i = 0; status == 0 && i < found.gl_pathc; ++i) {
    const fs::path path = found.gl_pathv[i];
    all.push_back({.name = series_name(path),
                   .source = fmt::format("'{}'", path.string()),
                   .input = path,
                   .output = {},
                   .options = {}});
  }
  globfree(&found);
  if (all.empty())
    throw Error(
        fmt::format("no file has a name like '{}': give a table, or a pattern in quotes, as "
                    "in 'data/*.mrc'",
                    pattern));
  tell_apart(all);
  return all;
}

std::vector<Series> read_star(const fs::path& path) {
  if (!io::lists_tomograms(path)) return expand_pattern(path.string());
  std::vector<Series> all;
  for (const io::RelionTomogram& tomogram : io::read_relion_tomograms(path).tomograms)
    all.push_back({.name = tomogram.name,
                   .source = fmt::format("'{}' of '{}'", tomogram.name, path.string()),
                   .input = path,
                   .output = {},
                   .options = {{kSeriesOption, tomogram.name}},
                   .is_tomogram = true});
  return all;
}

void check_names(const std::vector<Series>& all, base::Faults& faults) {
  std::map<std::string, const Series*> names;
  std::map<fs::path, const Series*> outputs;
  for (const Series& series : all) {
    const bool is_file_name = !series.name.empty() && series.name.front() != '.' &&
                              series.name.find('/') == std::string::npos &&
                              base::printable(series.name) == series.name;
    if (base::utf8_text(series.name) != series.name)
      faults.add(
          fmt::format("{}: '{}' is not UTF-8, and the list of a batch cannot hold it: give the "
                      "file another name",
                      series.source, base::printable(series.name)));
    else if (!is_file_name)
      faults.add(fmt::format("{}: '{}' cannot be the name of a file; {}", series.source,
                             series.name, advice_on_name(series)));
    const auto [named, is_new_name] = names.emplace(series.name, &series);
    if (!is_new_name)
      faults.add(fmt::format("{} and {} have the same name '{}': {}", named->second->source,
                             series.source, series.name, advice_on_name(series)));
    const auto [same, is_new] =
        outputs.emplace(fs::absolute(series.output).lexically_normal(), &series);
    if (!is_new && is_new_name)
      faults.add(fmt::format("{} and {} have the same output '{}'", same->second->source,
                             series.source, series.output.string()));
  }
}

void require_none(const base::Faults& mistakes) {
  const std::vector<std::string>& sentences = mistakes.sentences();
  if (sentences.empty()) return;
  if (sentences.size() == 1) throw Error(sentences.front());
  for (const std::string& sentence : sentences) base::log_info(sentence);
  throw Error(fmt::format("these {} mistakes are to be mended first; nothing was started",
                          sentences.size()));
}

}  // namespace tomofield::batch
