#include "option_table/documentation.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <filesystem>
#include <optional>
#include <string_view>
#include <type_traits>
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
- The name is that of the argument in Python, and of the member in C++: of `tomofield::SeriesFiles`,
  or of a section of `tomofield::Options` (`options.fit.epochs`). `field` is `options.field.kind`.
- The key is the name in the JSON beside a tomogram, under `options`, where every option has the
  value that was used.
- An option with an automatic default takes the word `auto` as well, on the command line and in a
  configuration file. In Python `None` stands for it.
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

constexpr std::string_view kPythonHead =
    R"(# Made by build/release/options_markdown --python from src/option_table/rows.cc: change that file.
"""The options of a reconstruction, as keyword arguments of tomofield.reconstruct()."""

import os
from typing import Literal, Optional, Tuple, TypedDict, Union

_Path = Union[str, "os.PathLike[str]"]


class Options(TypedDict, total=False):
    """Everything that a user can choose; docs/options.md lists units, ranges and defaults.

    Options that may be None are chosen from the data or from the other options unless they are
    given. Lengths on the specimen are unbinned pixels of the aligned view; lengths of the field are
    binned pixels.
    """
)";

// Returns the type of a value in Python.
template <typename T>
std::string python_type(const Row& row) {
  if constexpr (std::is_enum_v<T>) {
    std::vector<std::string> names;
    for (const auto& [value, _] : base::EnumNames<T>::kNames)
      names.push_back(fmt::format("\"{}\"", python_name_of(value)));
    return fmt::format("Literal[{}]", fmt::join(names, ", "));
  } else if constexpr (std::is_same_v<T, bool>) {
    return "bool";
  } else if constexpr (std::is_integral_v<T>) {
    return row.range.kind == Range::Kind::kEither
               ? fmt::format("Literal[{}, {}]", row.range.low, row.range.high)
               : "int";
  } else if constexpr (std::is_floating_point_v<T>) {
    return "float";
  } else if constexpr (std::is_same_v<T, std::string>) {
    return "str";
  } else if constexpr (std::is_same_v<T, std::filesystem::path>) {
    return "_Path";
  } else {
    static_assert(std::is_same_v<T, Rectangle>);
    return "Tuple[int, int, int, int]";
  }
}

template <typename T>
std::string type_of(const Row& row, Reference<T>) {
  return python_type<T>(row);
}
template <typename T>
std::string type_of(const Row& row, Reference<std::optional<T>>) {
  return fmt::format("Optional[{}]", python_type<T>(row));
}
template <typename T>
std::string type_of(const Row& row, Reference<Choice<T>>) {
  return fmt::format("Optional[{}]", python_type<T>(row));
}

}  // namespace

std::string options_python() {
  std::string page(kPythonHead);
  const Row* previous = nullptr;
  for (const Row& row : all_rows()) {
    if (row.name == "stack") continue;  // the first argument
    if (previous == nullptr || previous->group != row.group)
      page += fmt::format("\n    # {}\n", title_of(row.group));
    page += fmt::format("    {}: {}\n", row.name,
                        std::visit([&](auto member) { return type_of(row, member); }, row.member));
    previous = &row;
  }
  return page;
}

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
