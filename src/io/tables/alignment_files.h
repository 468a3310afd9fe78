#pragma once

#include <array>
#include <cstdint>
#include <filesystem>
#include <optional>
#include <string_view>
#include <vector>

namespace tomofield::io {

// Readers of the small text files that accompany a tilt series. They check each file by itself and
// keep line numbers, so that the code that compares a file with the stack can point at a line. All
// throw Error with the file, the line and its text.

/// A number and the line on which it stands.
struct NumberLine {
  double value = 0.0;
  int line = 0;
};

/// Reads a .tlt, .rawtlt or .xtilt file: one number a line, one line a section. Throws Error for a
/// line with several columns, because nothing says which one counts, and for a line without a
/// number from −360 to 360; the message says that `quantity` ("a tilt angle in degrees") was
/// expected.
std::vector<NumberLine> read_number_column(const std::filesystem::path& path,
                                           std::string_view quantity);

/// IMOD's transform from raw to aligned coordinates of one section: q = A p + shift, where p is
/// relative to the centre of the raw image and q to the centre of the aligned one, in unbinned
/// pixels.
struct ImodTransform {
  double a11 = 1.0, a12 = 0.0, a21 = 0.0, a22 = 1.0;
  double shift_x_px = 0.0, shift_y_px = 0.0;
};

/// Reads an .xf file: `A11 A12 A21 A22 DX DY`, one line a section. Throws Error for a singular A,
/// and for one that stretches a direction by less than 0.01 or more than 100.
std::vector<ImodTransform> read_imod_transforms(const std::filesystem::path& path);

/// The entries of one [ZValue = n] section that tomofield uses.
struct MdocSection {
  std::int64_t section = 0;  ///< n, zero-based
  int line = 0;              ///< line of the tilt angle, or of the section's head without one
  std::optional<double> tilt_deg;
  std::optional<double> pixel_spacing_A;
  std::optional<double> prior_dose;  ///< PriorRecordDose: electrons / Å² before this section
  std::optional<double> dose;        ///< ExposureDose: electrons / Å² of this section; 0: unknown
  std::optional<std::int64_t> time_s;  ///< DateTime, in seconds from some day on
  std::string frame_name;              ///< SubFramePath without its folders
};

/// The tilt axis of the images, counter-clockwise from +Y, and the line that says so.
using AxisAngle = NumberLine;

/// The contents of SerialEM's .mdoc, with sections in ascending order of n.
struct Mdoc {
  std::optional<double> pixel_spacing_A;  ///< value of the series, or of its first section
  /// "[T = Tilt axis angle = X]", else TiltAxisAngle. RotationAngle is another angle.
  std::optional<AxisAngle> tilt_axis_deg;
  std::string image_file;  ///< ImageFile: the stack, without its folders
  std::vector<MdocSection> sections;
};

/// Reads an .mdoc file. Skips unknown keys, because SerialEM adds new ones every year. Throws Error
/// for a section that comes twice.
Mdoc read_mdoc(const std::filesystem::path& path);

/// Returns the indices of the sections of an .mdoc in the order in which they were recorded: by
/// DateTime, else by PriorRecordDose, else by their numbers. A key counts if all sections have it
/// and no two are equal.
std::vector<std::size_t> acquisition_order(const Mdoc& mdoc);

/// AreTomo's global alignment of one section: raw − centre = R(rotation) q + shift.
struct AreTomoRow {
  std::int64_t section = 0;  ///< SEC as written; assign_aretomo_sections interprets it
  int line = 0;
  double rotation_deg = 0.0;  ///< angle of the tilt axis, counter-clockwise from +Y
  double magnification = 1.0;
  double shift_x_px = 0.0, shift_y_px = 0.0;
  double tilt_deg = 0.0;
};

/// The contents of AreTomo's .aln file.
struct AreTomoAlignment {
  std::optional<std::array<std::int64_t, 3>> raw_size;  ///< size of the stack that was aligned
  std::vector<std::int64_t> dark_sections;              ///< second number of each # DarkFrame line
  std::vector<double> dark_tilt_deg;                    ///< its third number, if every line has one
  double alpha_offset_deg = 0.0;                        ///< already included in the rows' angles
  double beta_offset_deg = 0.0;
  std::optional<double> thickness;  ///< of the specimen, in pixels; none if it was not measured
  std::vector<AreTomoRow> rows;
  std::int64_t num_local_rows = 0;  ///< number of rows for patches, which are not used
};

/// Reads an .aln file. Rows of local alignments are counted and skipped.
AreTomoAlignment read_aretomo_alignment(const std::filesystem::path& path);

/// Returns the zero-based section of the stack for each row. AreTomo's versions count SEC from 0 or
/// from 1, and before or after the removal of dark frames; the stack may also be the one before or
/// after the removal. The only numbering in which all rows fit `num_sections` is taken. Where 0
/// stands for the section of every dark frame, their tilts tell where they are among the rows.
/// Throws Error with both numbers and both files if there is no such numbering.
std::vector<std::int64_t> assign_aretomo_sections(const AreTomoAlignment& alignment,
                                                  const std::filesystem::path& aln,
                                                  std::int64_t num_sections,
                                                  const std::filesystem::path& stack);

/// Parses "1-3,40" to {0, 1, 2, 39}: sorted zero-based sections, each once. Empty text gives none.
/// Throws Error for sections outside 1…num_sections.
std::vector<std::int64_t> parse_section_list(std::string_view text, std::int64_t num_sections);

}  // namespace tomofield::io
