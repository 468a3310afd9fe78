// Clang 14 cannot compile gemmi's header as C++20 with the library of GCC 12, so that this file is
// compiled as C++17 (cmake/TomofieldLayers.cmake) and has nothing but gemmi.
#include "io/tables/star_parser.h"

#include <gemmi/cif.hpp>
#include <stdexcept>
#include <utility>

namespace tomofield::io {
namespace {

namespace cif = gemmi::cif;

// Removes the underscore that begins the name of every column in a file.
std::string column_name(const std::string& tag) { return tag.substr(1); }

// Returns the text of a cell. "?" and "." stand for no value in CIF, and are words in RELION.
std::string text_of(const std::string& cell) {
  return cif::is_null(cell) ? cell : cif::as_string(cell);
}

ParsedTable table_of_loop(const std::string& name, const cif::Loop& loop) {
  ParsedTable table{name, {}, {}};
  for (const std::string& tag : loop.tags) table.columns.push_back(column_name(tag));
  for (std::size_t row = 0; row < loop.length(); ++row) {
    std::vector<std::string>& cells = table.rows.emplace_back();
    for (std::size_t column = 0; column < loop.width(); ++column)
      cells.push_back(text_of(loop.val(row, column)));
  }
  return table;
}

void append_tables(const cif::Block& block, std::vector<ParsedTable>& tables) {
  // gemmi's signs for no name: "#" up to version 0.5, and a blank later
  const std::string name = block.name == "#" || block.name == " " ? "" : block.name;
  ParsedTable single{name, {}, {{}}};
  for (const cif::Item& item : block.items) {
    if (item.type == cif::ItemType::Frame)
      throw std::runtime_error("the save frame 'save_" + item.frame.name +
                               "', which no table of RELION or Warp has: leave it out");
    if (item.type == cif::ItemType::Loop) tables.push_back(table_of_loop(name, item.loop));
    if (item.type != cif::ItemType::Pair) continue;
    single.columns.push_back(column_name(item.pair[0]));
    single.rows.front().push_back(text_of(item.pair[1]));
  }
  if (!single.columns.empty()) tables.push_back(std::move(single));
}

}  // namespace

std::vector<ParsedTable> parse_star(const std::string& text) {
  const cif::Document document = cif::read_memory(text.data(), text.size(), "line");
  std::vector<ParsedTable> tables;
  for (const cif::Block& block : document.blocks) append_tables(block, tables);
  return tables;
}

}  // namespace tomofield::io
