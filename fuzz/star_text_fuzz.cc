#include <algorithm>
#include <cstdlib>
#include <string>
#include <vector>

#include "fuzz_input.h"
#include "io/tables/star_file.h"

// A STAR file that the program writes is read as it was: the input is the cells of a table, with a
// zero byte behind each.
extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace tomofield;
  const std::vector<std::string> columns{"rlnTomoName", "rlnTomoTiltSeriesStarFile"};
  io::StarTable table("global", columns);
  std::vector<std::string> cells;
  for (const std::uint8_t* end = data + size; data < end;) {
    const std::uint8_t* zero = std::find(data, end, 0);
    cells.emplace_back(data, zero);
    data = zero == end ? end : zero + 1;
    if (cells.size() < columns.size()) continue;
    table.add_row(std::move(cells));
    cells.clear();
  }
  if (table.num_rows() == 0) return 0;
  std::string text;
  try {
    text = io::star_file_text(table);
  } catch (const Error&) {  // a value that no quotes can hold
    return 0;
  }
  const fuzz::InputFile file(text.data(), text.size());
  const std::vector<io::StarTable> read = io::read_star_file(file.path());
  if (read.size() != 1 || read[0].num_rows() != table.num_rows()) std::abort();
  for (std::size_t row = 0; row < table.num_rows(); ++row)
    for (const std::string& column : columns)
      if (read[0].find(row, column) != table.find(row, column)) std::abort();
  return 0;
}
