#pragma once

#include <array>
#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "io/tables/star_file.h"
#include "io/tables/view_table.h"

namespace tomofield::io {

/// One tomogram of RELION 5's tomograms.star, whose views are read by read_view_table().
struct RelionTomogram {
  std::string name;
  std::string tilt_series_star;  ///< as it is written, from RELION's project folder
  std::optional<double> pixel_size_A;
  std::optional<int> defocus_hand;      ///< as in a ViewTable
  std::optional<double> defocus_slope;  ///< of the same with the height; 1: as it is
  StatedOptics optics;
  std::optional<double> recorded_pixel_A;  ///< for which that of the detector counts
  std::string mtf;  ///< the file of the detector's transfer function, or empty
  std::optional<std::array<std::int64_t, 3>> size_px;  ///< unbinned
  std::vector<std::string> not_applied{};  ///< distortions that its row states, for messages
};

/// A tomograms.star, or a STAR file of tilt series that has the same table without volumes.
struct RelionTomograms {
  StarTable table;  ///< with all columns
  std::vector<RelionTomogram> tomograms;
  std::optional<std::string> remark{};  ///< names columns that are not known
};

/// Returns true if a STAR file lists tomograms; one of a single tilt series lists views. Throws
/// Error if it is no STAR file.
bool lists_tomograms(const std::filesystem::path& path);

/// Reads a tomograms.star. Throws Error with the row for what is missing or cannot be.
RelionTomograms read_relion_tomograms(const std::filesystem::path& path);

/// Returns the table of the views of a tilt-series STAR file with all columns; read_relion_views()
/// says what they mean. Throws Error if there is none.
StarTable read_relion_rows(const std::filesystem::path& path);

/// Writes the angles and the shift of a view into the columns of a row of such a table.
void set_relion_alignment(const ListedView& view, std::size_t row, StarTable& table);

}  // namespace tomofield::io
