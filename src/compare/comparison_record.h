#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "compare/table.h"

namespace tomofield::compare {

/// What a comparison has found (comparison.json). The commands and the volumes are in the order of
/// the table's methods.
struct ComparisonRecord {
  std::filesystem::path series;
  std::optional<std::filesystem::path> truth;
  std::vector<std::vector<std::string>> commands;
  std::vector<std::filesystem::path> volumes;
  Table table;
};

void write_comparison(const std::filesystem::path& file, const ComparisonRecord& record);

}  // namespace tomofield::compare
