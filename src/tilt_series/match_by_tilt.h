#pragma once

#include <cstddef>
#include <optional>
#include <span>
#include <vector>

namespace tomofield::tilt_series {

/// Matches a table that has not exactly one row a section, because sections were cut from the stack
/// or left out of the table, by tilt angles (degrees, as recorded). Returns the row of each section
/// that has an angle, or nothing if the tilts do not tell: if a section is nearest to no row within
/// half a step of the tilts and 1°, or two rows are as near (unless as many sections are, which are
/// in the same order), or two sections take one row.
std::optional<std::vector<std::optional<std::size_t>>> match_by_tilt(
    std::span<const std::optional<double>> section_tilt_deg,
    std::span<const std::optional<double>> row_tilt_deg);

}  // namespace tomofield::tilt_series
