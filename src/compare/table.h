#pragma once

#include <optional>
#include <string>
#include <vector>

#include "compare/rows.h"
#include "report/html.h"

namespace tomofield::compare {

/// A column of the table.
struct Column {
  enum class Better { kHigher, kLower, kNeither };
  std::string key;    ///< its name in JSON and CSV
  std::string title;  ///< its head in the report, with the unit
  Better better = Better::kNeither;
  int digits = 2;
};

/// The metrics of every method: values[row][column], empty where a method has none.
struct Table {
  std::vector<Column> columns;
  std::vector<Method> methods;
  std::vector<std::vector<std::optional<double>>> values;

  /// Adds a column, one value a method.
  void add(Column column, const std::vector<std::optional<double>>& metrics);
  /// Returns the row of the best value of a column. Returns nothing if neither higher nor lower is
  /// better.
  std::optional<std::size_t> best_row(std::size_t column) const;
  /// Returns true if a row's value is better than that of the first row, which is the main method.
  bool beats_first(std::size_t row, std::size_t column) const;
};

/// Returns the costs of every method: core-seconds, wall-clock seconds, memory and parameters.
Table table_of_costs(const std::vector<Row>& rows);

/// Returns the table as comma-separated text with a head. A missing value is empty.
std::string table_csv(const Table& table);
/// Returns the cells with their marks: "best" is the best of its column, "better" is better than
/// the main method's value in the first row.
std::vector<std::vector<report::HtmlCell>> table_cells(const Table& table);

}  // namespace tomofield::compare
