#pragma once

#include <cstddef>
#include <filesystem>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "base/plausible.h"

namespace tomofield::io {

/// One table of a STAR file: text by row and column. Names of columns have no leading underscore. A
/// table without "loop_", whose values stand beside their names, has one row.
class StarTable {
 public:
  StarTable(std::string name, std::vector<std::string> columns);

  const std::string& name() const { return name_; }
  const std::vector<std::string>& columns() const { return columns_; }
  std::size_t num_rows() const { return columns_.empty() ? 0 : cells_.size() / columns_.size(); }
  bool has_column(std::string_view column) const { return index_of(column).has_value(); }
  /// Returns a value as it stands in the file, without quotes; nothing without such a column.
  std::optional<std::string> find(std::size_t row, std::string_view column) const;

  /// Returns a table of the same columns with some of the rows.
  StarTable only(const std::vector<std::size_t>& rows) const;
  /// Adds a row, with one value a column.
  void add_row(std::vector<std::string> cells);
  /// Sets one value. A column that is new is added at the end, with "None" in the other rows.
  void set(std::size_t row, const std::string& column, std::string value);
  /// Removes a column. Does nothing without such a column.
  void remove(std::string_view column);

 private:
  std::optional<std::size_t> index_of(std::string_view column) const;

  std::string name_;
  std::vector<std::string> columns_;
  std::vector<std::string> cells_;  // [row, column]
};

/// Reads the tables of a STAR file. Throws Error with the line for a file that is none, and with
/// the column for a value that star_file_text() cannot write again.
std::vector<StarTable> read_star_file(const std::filesystem::path& path);

/// Returns the first table that has a column, or nothing.
const StarTable* find_table(const std::vector<StarTable>& tables, std::string_view column);

/// Returns the only table of a file that has a column, or null. Throws Error if several have it.
const StarTable* find_only_table(const std::filesystem::path& path,
                                 const std::vector<StarTable>& tables, std::string_view column);

/// Throws Error for a text that no STAR file can hold, even in quotes.
void require_star_text(const std::string& value);

/// Returns a STAR file with one table, in RELION's form. Values that need it are quoted, so that
/// read_star_file() finds them as they are. Throws Error for a value that no quotes can hold.
std::string star_file_text(const StarTable& table);

/// Reads the values of one row. Errors name the file, the table, the row (from 1) and the column.
class StarRow {
 public:
  StarRow(const std::filesystem::path& path, const StarTable& table, std::size_t row)
      : path_(path), table_(table), row_(row) {}

  /// Returns a text that must be there.
  std::string text(std::string_view column) const;
  /// Returns a text, or nothing if there is no such column, or if its value stands for nothing.
  std::optional<std::string> find_text(std::string_view column) const;
  /// Returns a number from −`largest` to `largest` that must be there.
  double number(std::string_view column, double largest = base::kLargestNumber) const;
  /// Returns a number, or nothing if there is no such column, or if its value stands for nothing.
  std::optional<double> find_number(std::string_view column,
                                    double largest = base::kLargestNumber) const;
  /// Returns the number in a column that a table has whole or not at all, or nothing if there is no
  /// such column. Throws Error for a value that stands for nothing.
  std::optional<double> find_stated_number(std::string_view column,
                                           double largest = base::kLargestNumber) const;
  /// Returns the dose of a column, as find_stated_number() does. Throws Error for a negative one
  /// too.
  std::optional<double> find_dose(std::string_view column) const;

 private:
  std::string where() const;

  const std::filesystem::path& path_;
  const StarTable& table_;
  std::size_t row_;
};

}  // namespace tomofield::io
