#include "option_table/documentation.h"

#include <fmt/format.h>

#include <string_view>
#include <vector>

#include "option_table/rows.h"
#include "option_table/values.h"

namespace tomofield::option_table {
namespace {

constexpr std::string_view kIntroduction =
    R"(<!-- Made by build/release/options_markdown from src/option_table/rows.cc: change that file. -->
# Options of a reconstruction

This page lists every option of `tomofield reconstruct` and of `tomofield::Options`, the same from
C++, Python, the command line and a configuration file. `tomofield reconstruct --help` shows the
options that people use, `--help-all` shows all of them. The other commands (`baseline`, `evaluate`,
`compare`, `export`, `info`) share the groups that they need.

- The command line takes a value after a space or an equals sign: `--rank 16`, `--center=-3,20`.
- `--config FILE.toml` reads options from a file: `rank = 16`, `tune = true`, `roi = [0, 0, 512, 512]`.
  Options on the command line win.
- The name is that of the member of `tomofield::Options` (of `tomofield::SeriesFiles` for files) in
  C++, and of the argument in Python.
- The key is the name in the JSON beside a tomogram, under `options`, where every option has the
  value that was used.
- An option with an automatic default takes the word `auto` as well.
- Unbinned pixels are those of the aligned view before `--bin`; binned pixels are those after it.
- Only the command line has `--threads N` (default: the processors that this process may use, or
  `OMP_NUM_THREADS`; the result is the same for any number), `--dry-run` (checks everything and prints
  the plan, with the [memory, time and disk](batch.md#what---dry-run-estimates) that it needs),
  `--plan FILE.json` (writes them for programs, without reading the views), `--trace FILE.json` (writes
  what the run did and when) and `--config`.
)";

// Escapes what Markdown would take for the end of a cell.
std::string cell(std::string_view text) {
  std::string escaped;
  for (const char c : text) {
    if (c == '|') escaped += '\\';
    escaped += c;
  }
  return escaped;
}

std::string default_text(const Row& row) {
  if (row.is_required) return "required";
  if (!row.automatic.empty()) return fmt::format("automatic: {}", row.automatic);
  if (is_flag(row)) return "off";
  return text_of(row, {}).value_or("none");
}

std::string value_text(const Row& row) {
  if (is_flag(row)) return "";
  const std::string range = row.range.text();
  const std::string label = range.empty() ? fmt::format("`{}`", label_of(row)) : range;
  return row.unit.empty() ? label : fmt::format("{} ({})", label, row.unit);
}

std::string line_of(const Row& row) {
  const std::string flag(row.flag);
  return fmt::format("| `{}` | {} | {} | {} | `{}` | `{}` |\n", flag, cell(value_text(row)),
                     cell(default_text(row)), cell(row.help), row.name, row.key);
}

}  // namespace

std::string options_markdown() {
  std::string page(kIntroduction);
  const Row* previous = nullptr;
  for (const Row& row : all_rows()) {
    if (previous == nullptr || previous->group != row.group)
      page += fmt::format(
          "\n## {}\n\n| option | value | default | meaning | name | key |\n|-|-|-|-|-|-|\n",
          title_of(row.group));
    page += line_of(row);
    previous = &row;
  }
  return page;
}

}  // namespace tomofield::option_table
