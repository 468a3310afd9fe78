#pragma once

#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <vector>

#include "compare/rows.h"
#include "report/html.h"

namespace tomofield::compare {

/// What a column of the table measures.
struct Column {
  enum class Better { kHigher, kLower, kNeither };
  std::string key;    ///< in JSON and CSV
  std::string title;  ///< with its unit, for people
  Better better = Better::kNeither;
  int digits = 2;
};

/// The figures of every method: values[row][column], none where a method has none.
struct Table {
  std::vector<Column> columns;
  std::vector<Method> methods;
  std::vector<std::vector<std::optional<double>>> values;

  /// A column of figures, one a method.
  void add(Column column, const std::vector<std::optional<double>>& figures);
  /// Of the best value of a column: the row, if the column has a better and a worse.
  std::optional<std::size_t> best_row(std::size_t column) const;
  /// Whether a row's value is better than the first row's, which is the main method.
  bool beats_first(std::size_t row, std::size_t column) const;
};

/// What every method took: core-seconds, wall-clock seconds, memory and parameters.
Table table_of_costs(const std::vector<Row>& rows);

nlohmann::json table_json(const Table& table);
/// Comma-separated, with a head; empty where there is no value.
std::string table_csv(const Table& table);
/// Marked: "best" in its column, "better" than the main method's, which has the first row.
std::vector<std::vector<report::HtmlCell>> table_cells(const Table& table);

}  // namespace tomofield::compare
