#include "compare/table.h"

#include <fmt/format.h>

namespace tomofield::compare {
namespace {

bool is_better(Column::Better better, double a, double b) {
  return better == Column::Better::kHigher ? a > b : a < b;
}

std::string cell_text(const std::optional<double>& value, int digits) {
  return value ? fmt::format("{:.{}f}", *value, digits) : "–";
}

}  // namespace

void Table::add(Column column, const std::vector<std::optional<double>>& metrics) {
  columns.push_back(std::move(column));
  values.resize(methods.size());
  for (std::size_t row = 0; row < methods.size(); ++row) values[row].push_back(metrics[row]);
}

std::optional<std::size_t> Table::best_row(std::size_t column) const {
  const Column::Better better = columns[column].better;
  if (better == Column::Better::kNeither) return std::nullopt;
  std::optional<std::size_t> best;
  for (std::size_t row = 0; row < values.size(); ++row) {
    const auto& value = values[row][column];
    if (value && (!best || is_better(better, *value, *values[*best][column]))) best = row;
  }
  return best;
}

bool Table::beats_first(std::size_t row, std::size_t column) const {
  const Column::Better better = columns[column].better;
  const auto &value = values[row][column], &first = values.front()[column];
  return better != Column::Better::kNeither && value && first && is_better(better, *value, *first);
}

Table table_of_costs(const std::vector<Row>& rows) {
  Table table;
  std::vector<std::optional<double>> core, wall, memory, parameters;
  for (const Row& row : rows) {
    table.methods.push_back(row.run.method);
    core.push_back(row.state.costs.core_seconds);
    wall.push_back(row.state.costs.wall_seconds);
    memory.push_back(static_cast<double>(row.state.costs.peak_bytes) / (1 << 20));
    const auto count = row.summary.num_parameters;
    parameters.push_back(count ? std::optional(*count / 1e6) : std::nullopt);
  }
  table.add({"core_seconds", "core‑s", Column::Better::kLower, 1}, core);
  table.add({"wall_seconds", "wall, s", Column::Better::kLower, 1}, wall);
  table.add({"peak_MiB", "memory, MiB", Column::Better::kLower, 0}, memory);
  table.add({"parameters_M", "parameters, M", Column::Better::kNeither, 3}, parameters);
  return table;
}

std::string table_csv(const Table& table) {
  std::string csv = "method";
  for (const Column& column : table.columns) csv += "," + column.key;
  for (std::size_t row = 0; row < table.methods.size(); ++row) {
    csv += "\n" + table.methods[row].name;
    for (const auto& value : table.values[row]) csv += value ? fmt::format(",{}", *value) : ",";
  }
  return csv + "\n";
}

std::vector<std::vector<report::HtmlCell>> table_cells(const Table& table) {
  std::vector<std::vector<report::HtmlCell>> cells{{{"method", ""}}};
  for (const Column& column : table.columns) cells.front().push_back({column.title, ""});
  for (std::size_t row = 0; row < table.methods.size(); ++row) {
    cells.push_back({{table.methods[row].title, ""}});
    for (std::size_t c = 0; c < table.columns.size(); ++c) {
      std::string mark = table.best_row(c) == row ? "best" : "";
      if (table.beats_first(row, c)) mark += " better";
      cells.back().push_back({cell_text(table.values[row][c], table.columns[c].digits), mark});
    }
  }
  return cells;
}

}  // namespace tomofield::compare
