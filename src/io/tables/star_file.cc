#include "io/tables/star_file.h"

#include <fmt/format.h>
#include <strings.h>

#include <algorithm>
#include <array>
#include <cctype>
#include <stdexcept>
#include <utility>

#include "base/check.h"
#include "io/tables/star_escapes.h"
#include "io/tables/star_parser.h"
#include "io/tables/text_lines.h"
#include "tomofield/error.h"

namespace tomofield::io {
namespace {

bool stands_for_nothing(const std::string& value) {
  return value.empty() || value == "None" || value == "none" || value == "?" || value == "." ||
         value == "<NA>";
}

// Words that begin a part of a STAR file, in any case (Hall, J. Chem. Inf. Comput. Sci. 31, 326,
// 1991), and those that stand for no value.
bool is_reserved(std::string_view value) {
  if (value == "?" || value == ".") return true;
  std::string word(value);
  std::ranges::transform(word, word.begin(),
                         [](unsigned char c) { return static_cast<char>(std::tolower(c)); });
  return std::ranges::any_of(std::array{"data_", "save_", "loop_", "stop_", "global_"},
                             [&](std::string_view reserved) { return word.starts_with(reserved); });
}

bool fits_a_field(const std::string& value) {
  return value.find("\n;") == std::string::npos && value.find('\r') == std::string::npos;
}

// Returns a value in quotes if it needs them, or nothing if no quotes can hold it.
std::optional<std::string> quoted_where_needed(const std::string& value) {
  if (value.empty()) return "\"\"";
  const bool has_lines = value.find_first_of("\r\n") != std::string::npos;
  const auto needs_quotes = [](unsigned char c) {
    return c <= ' ' || c > '~' || c == '"' || c == '\'' || c == '#';
  };
  const bool is_plain = std::ranges::none_of(value, needs_quotes) &&
                        std::string_view("_$;[]").find(value.front()) == std::string_view::npos &&
                        !is_reserved(value);
  if (is_plain) return value;
  for (const char quote : {'"', '\''})
    if (!has_lines && value.find(quote) == std::string::npos) return quote + value + quote;
  // A text field: it stands between lines that begin with a semicolon.
  return fits_a_field(value) ? std::optional("\n;" + value + "\n;\n") : std::nullopt;
}

std::string star_text(const std::string& value) {
  if (const auto text = quoted_where_needed(value)) return *text;
  throw Error(fmt::format("'{}' cannot be written into a STAR file", quote(value)));
}

// Refuses what could be read and not be written again, such as a carriage return within quotes.
void require_texts(const std::filesystem::path& path, const std::vector<std::string>& columns,
                   const std::vector<std::string>& row) {
  for (std::size_t i = 0; i < row.size(); ++i)
    if (!quoted_where_needed(row[i]))
      throw Error(fmt::format(
          "'{}': the value '{}' of _{} has {}, which no STAR file can hold: write it without",
          path.string(), quote(row[i]), columns[i],
          row[i].find('\r') != std::string::npos ? "a carriage return"
                                                 : "lines of which one begins with a semicolon"));
}

}  // namespace

StarTable::StarTable(std::string name, std::vector<std::string> columns)
    : name_(std::move(name)), columns_(std::move(columns)) {}

std::optional<std::size_t> StarTable::index_of(std::string_view column) const {
  // Names are the same in upper and lower case (Hall 1991), which gemmi compares, too.
  const auto found = std::ranges::find_if(columns_, [&](const std::string& name) {
    return name.size() == column.size() &&
           strncasecmp(name.c_str(), column.data(), name.size()) == 0;
  });
  if (found == columns_.end()) return std::nullopt;
  return static_cast<std::size_t>(found - columns_.begin());
}

std::optional<std::string> StarTable::find(std::size_t row, std::string_view column) const {
  const auto index = index_of(column);
  if (!index) return std::nullopt;
  return cells_[row * columns_.size() + *index];
}

StarTable StarTable::only(const std::vector<std::size_t>& rows) const {
  StarTable table(name_, columns_);
  for (const std::size_t row : rows) {
    const auto first = cells_.begin() + static_cast<std::ptrdiff_t>(row * columns_.size());
    table.add_row({first, first + std::ssize(columns_)});
  }
  return table;
}

void StarTable::add_row(std::vector<std::string> cells) {
  TOMOFIELD_CHECK(cells.size() == columns_.size(), "a row has one value a column");
  std::move(cells.begin(), cells.end(), std::back_inserter(cells_));
}

void StarTable::set(std::size_t row, const std::string& column, std::string value) {
  if (!has_column(column)) {
    const std::size_t rows = num_rows(), width = columns_.size();
    for (std::size_t i = rows; i-- > 0;)
      cells_.insert(cells_.begin() + static_cast<std::ptrdiff_t>((i + 1) * width), "None");
    columns_.push_back(column);
  }
  cells_[row * columns_.size() + *index_of(column)] = std::move(value);
}

void StarTable::remove(std::string_view column) {
  const auto index = index_of(column);
  if (!index) return;
  const std::size_t width = columns_.size();
  for (std::size_t row = num_rows(); row-- > 0;)
    cells_.erase(cells_.begin() + static_cast<std::ptrdiff_t>(row * width + *index));
  columns_.erase(columns_.begin() + static_cast<std::ptrdiff_t>(*index));
}

std::vector<StarTable> read_star_file(const std::filesystem::path& path) {
  std::string text = read_text_file(path);
  constexpr std::string_view kByteOrderMark = "\xEF\xBB\xBF";
  if (text.starts_with(kByteOrderMark)) text.erase(0, kByteOrderMark.size());
  std::vector<StarTable> tables;
  try {
    for (ParsedTable& parsed : parse_star(escaped_star(text))) {
      for (std::string& column : parsed.columns) column = unescaped_star(column);
      StarTable& table =
          tables.emplace_back(unescaped_star(parsed.name), std::move(parsed.columns));
      for (auto& row : parsed.rows) {
        for (std::string& cell : row) cell = unescaped_star(cell);
        require_texts(path, table.columns(), row);
        table.add_row(std::move(row));
      }
    }
  } catch (const Error&) {
    throw;
  } catch (const std::runtime_error& error) {
    // gemmi writes "line:NUMBER:COLUMN: what"
    throw Error(
        fmt::format("'{}' is no STAR file, or a damaged one: {}", path.string(), error.what()));
  }
  return tables;
}

const StarTable* find_table(const std::vector<StarTable>& tables, std::string_view column) {
  const auto found = std::find_if(tables.begin(), tables.end(),
                                  [&](const StarTable& table) { return table.has_column(column); });
  return found == tables.end() ? nullptr : &*found;
}

const StarTable* find_only_table(const std::filesystem::path& path,
                                 const std::vector<StarTable>& tables, std::string_view column) {
  const auto has_column = [&](const StarTable& table) { return table.has_column(column); };
  if (std::ranges::count_if(tables, has_column) > 1)
    throw Error(
        fmt::format("'{}' has several tables with _{}: leave one of them", path.string(), column));
  return find_table(tables, column);
}

void require_star_text(const std::string& value) { star_text(value); }

std::string star_file_text(const StarTable& table) {
  std::string text = fmt::format("\n# version 50001\n\ndata_{}\n\nloop_\n", table.name());
  int number = 0;
  for (const std::string& column : table.columns())
    text += fmt::format("_{} #{}\n", column, ++number);
  for (std::size_t row = 0; row < table.num_rows(); ++row) {
    for (const std::string& column : table.columns())
      text += star_text(*table.find(row, column)) + '\t';
    text.back() = '\n';
  }
  return text;
}

std::string StarRow::where() const {
  return fmt::format("'{}', table 'data_{}', row {}", path_.string(), table_.name(), row_ + 1);
}

std::optional<std::string> StarRow::find_text(std::string_view column) const {
  const auto value = table_.find(row_, column);
  return value && !stands_for_nothing(*value) ? value : std::nullopt;
}

std::string StarRow::text(std::string_view column) const {
  if (const auto found = find_text(column)) return *found;
  const auto value = table_.find(row_, column);
  throw Error(value ? fmt::format("{}: _{} is empty ('{}')", where(), column, *value)
                    : fmt::format("'{}': the table 'data_{}' has no column _{}", path_.string(),
                                  table_.name(), column));
}

std::optional<double> StarRow::find_number(std::string_view column, double largest) const {
  const auto value = find_text(column);
  if (!value) return std::nullopt;
  const auto number = parse_number(*value, largest);
  if (number) return number;
  throw Error(fmt::format("{}: '{}' in the column _{} is not a number from -{} to {}", where(),
                          quote(*value), column, largest, largest));
}

std::optional<double> StarRow::find_stated_number(std::string_view column, double largest) const {
  return table_.has_column(column) ? std::optional(number(column, largest)) : std::nullopt;
}

std::optional<double> StarRow::find_dose(std::string_view column) const {
  const auto dose = find_stated_number(column, kLargestDose);
  if (!dose || *dose >= 0.0) return dose;
  throw Error(fmt::format("{}: the dose {} in the column _{} is negative", where(), *dose, column));
}

double StarRow::number(std::string_view column, double largest) const {
  text(column);  // refuses a column that is not there
  return *find_number(column, largest);
}

}  // namespace tomofield::io
