#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "tilt_series/series_plan.h"

namespace tomofield::measurement {

/// The sections of a stack to which the rows of a table are matched.
struct Sections {
  const tilt_series::TiltSeriesOptions& input;
  std::string stack;
  std::int64_t count = 0;
  std::vector<std::optional<double>> tilt_deg;  ///< [section], as recorded; none: not used
  std::vector<std::string> images;              ///< [section], as ImageStack::image_name()
};

/// A table with a row a view: the contrast transfer, or doses.
struct RowsOfViews {
  std::filesystem::path file;
  bool is_ctf = false;
  bool is_of_aretomo = false;  ///< the rows are those of AreTomo's alignment, if there is one
  std::size_t count = 0;
  std::vector<std::optional<double>> tilt_deg;  ///< [row]; empty: not in the file
  std::vector<std::string> images = {};         ///< [row], as RELION writes them; empty: no names
};

using RowOfSection = std::vector<std::optional<std::size_t>>;  ///< [section]

/// Returns the row of a table for each section. Rows as many as sections are in their order, unless
/// their tilts are those of the sections in another order. Rows without tilts that name the images
/// of the sections are matched by these. Others are matched by the rows of AreTomo's alignment,
/// whose dark frames a table may leave out, or by tilt. Throws Error if nothing tells.
RowOfSection rows_of_sections(const Sections& sections, const RowsOfViews& table);

}  // namespace tomofield::measurement
