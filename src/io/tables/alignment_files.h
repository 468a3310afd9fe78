#pragma once

#include <array>
#include <cstdint>
#include <filesystem>
#include <optional>
#include <span>
#include <string>
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

/// The contents of a list of tilt angles, .tlt or .rawtlt, or of AreTomo 3's NAME_TLT.txt.
struct TiltTable {
  std::vector<NumberLine> angles;  ///< degrees, one a section
  std::vector<std::size_t> order;  ///< sections in the order of recording; empty: not in the file
  std::vector<double> doses;       ///< electrons / Å² of each section; empty: not in the file
};

/// Reads a list of tilt angles. A second column is the order of recording, from 0 or 1, and a third
/// the dose of each section, as in AreTomo 3. Throws Error as read_number_column() does, and for a
/// second column that is no order.
TiltTable read_tilt_table(const std::filesystem::path& path);

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
  std::optional<double> prior_dose;  ///< PriorRecordDose: electrons / Å² before this section
  int frame_doses_line = 0;          ///< of FrameDosesAndNumber, if it states doses
  std::optional<double> dose;        ///< ExposureDose: electrons / Å² of this section; 0: unknown
  std::optional<std::int64_t> time_s;       ///< DateTime, in seconds from some day on
  int unread_time_line = 0;                 ///< line of a DateTime that cannot be read, or 0
  std::optional<double> rotation_deg;       ///< RotationAngle
  std::optional<double> target_defocus_um;  ///< TargetDefocus: negative under focus
  std::string frame_name;                   ///< SubFramePath without its folders
  std::string place_of_piece;  ///< x and y of PieceCoordinates, of a montage; empty: not stated
};

/// The tilt axis of the images, counter-clockwise from +Y, and the line that says so.
using AxisAngle = NumberLine;

/// The contents of SerialEM's or Tomography's .mdoc, with sections in ascending order of n.
struct Mdoc {
  std::optional<double> pixel_spacing_A;  ///< of all sections
  /// SerialEM's "[T = Tilt axis angle = X]", else what TiltAxisAngle and RotationAngle say together
  /// (mdoc_axis.cc). RotationAngle alone is another angle.
  std::optional<AxisAngle> tilt_axis_deg;
  /// A TiltAxisAngle of Tomography from which the axis cannot be told.
  std::optional<AxisAngle> unclear_axis_deg;
  std::optional<AxisAngle> lone_rotation_deg;  ///< a RotationAngle, where nothing states an axis
  bool is_montage = false;                     ///< Montage: the images may be pieces
  int two_directions_line = 0;                 ///< of a title with "bidir =" or "dosym =", or 0
  std::optional<double> voltage_kV;
  std::optional<std::array<std::int64_t, 2>> image_size_px;  ///< ImageSize: of what PixelSpacing is
  std::string image_file;  ///< ImageFile: the stack, without its folders
  std::vector<MdocSection> sections;
  /// Says for messages what the file states twice and differently: two magnifications or binnings,
  /// or two tilt axes of which one is taken.
  std::vector<std::string> differences;
};

/// Returns what stands for the angle in SerialEM's title "Tilt axis angle = 85.9, binning = 1 …" of
/// an .mdoc or of the header of a stack, and nothing for other titles.
std::optional<std::string_view> axis_of_title(std::string_view title);
/// Does the same for Tomography's title "TiltAxisAngle = -175.9  Binning = 1 …".
std::optional<std::string_view> tomography_axis_of_title(std::string_view title);

/// Returns the tilt axes in degrees that SerialEM's titles among the labels of a stack state. One
/// that was rounded is no second axis.
std::vector<double> axes_of_labels(const std::vector<std::string>& labels);
/// Tells whether two angles of a tilt axis are not the same one, rounded.
bool are_two_axes(double a_deg, double b_deg);

/// Sets the axis of an .mdoc from a TiltAxisAngle and the RotationAngle of its first section.
/// Versions of Tomography write the former in three ways, which the latter tells apart, as in IMOD
/// (header.f90). Without it the axis stays unclear if `is_title`, the form of Tomography, and is
/// the angle itself otherwise.
void set_axis_of_tomography(const AxisAngle& stated, bool is_title, Mdoc& mdoc);

/// Reads an .mdoc file. Skips unknown keys, because SerialEM adds new ones every year, and sections
/// of other kinds. Throws Error for a section or an entry of it that comes twice, for pixel sizes
/// or voltages that differ, and for a montage.
Mdoc read_mdoc(const std::filesystem::path& path);

/// Returns the underfocus in µm at which the sections were to be recorded: the median of their
/// TargetDefocus. Returns nothing if none states one, or if it is not under focus.
std::optional<double> target_underfocus_um(const Mdoc& mdoc);

/// The order in which the sections of an .mdoc were recorded.
struct AcquisitionOrder {
  std::vector<std::size_t> sections;  ///< indices into Mdoc::sections
  bool is_stated = false;  ///< by a key; else sections count as recorded by their numbers
  /// Why the file's DateTime gives no order, as a phrase with its place. Empty if an order is
  /// stated, or if no section has a DateTime.
  std::string fault_of_times;
};

/// Returns the order by DateTime, else by PriorRecordDose, else by the numbers of the sections. A
/// key counts if all sections have it and no two are equal.
AcquisitionOrder acquisition_order(const Mdoc& mdoc);

/// AreTomo's global alignment of one section: raw − centre = R(rotation) q + shift.
struct AreTomoRow {
  std::int64_t section = 0;  ///< SEC as written; assign_aretomo_sections interprets it
  int line = 0;
  double rotation_deg = 0.0;  ///< angle of the tilt axis, counter-clockwise from +Y
  double magnification = 1.0;
  double shift_x_px = 0.0, shift_y_px = 0.0;
  double tilt_deg = 0.0;
};

/// How AreTomo moves one patch of one section beyond the alignment of all of it, in pixels. The
/// place counts from the centre of the raw image, where the global shift is undone.
struct AreTomoPatch {
  double x_px = 0.0, y_px = 0.0, shift_x_px = 0.0, shift_y_px = 0.0;
};

/// The contents of AreTomo's .aln file.
struct AreTomoAlignment {
  std::optional<std::array<std::int64_t, 3>> raw_size;  ///< size of the stack that was aligned
  std::vector<std::int64_t> dark_places;                ///< first number of each # DarkFrame line
  std::vector<std::int64_t> dark_sections;              ///< its second number
  std::vector<double> dark_tilt_deg;                    ///< its third number, if every line has one
  double alpha_offset_deg = 0.0;                        ///< already included in the rows' angles
  double beta_offset_deg = 0.0;
  std::optional<double> thickness;  ///< of the specimen, in pixels; none if it was not measured
  std::int64_t num_patches = 0;     ///< of each row of the local alignment; 0: not stated
  std::vector<AreTomoRow> rows;
  /// [row]: the patches whose shifts AreTomo calls good; empty without a local alignment.
  std::vector<std::vector<AreTomoPatch>> patches;
};

/// Reads an .aln file. Throws Error with the line for rows of the local alignment that are missing
/// or malformed, and with the column for a number that cannot be; without `needs_tilt` such a tilt
/// is 0, because another file has the tilts.
AreTomoAlignment read_aretomo_alignment(const std::filesystem::path& path, bool needs_tilt = true);

/// Returns the zero-based section of the stack for each row. AreTomo's versions count SEC from 0 or
/// from 1, and before or after the removal of dark frames; the stack may also be the one before or
/// after the removal. The only numbering in which all rows fit `num_sections` is taken. Where 0
/// stands for the section of every dark frame, their places in the order of tilt, which count from
/// 0, are their sections if the numbers of the rows agree (AreTomo 3's CDarkFrames::ToOneBased);
/// else their tilts tell where they are among the rows.
/// Throws Error with both numbers and both files if there is no such numbering.
std::vector<std::int64_t> assign_aretomo_sections(const AreTomoAlignment& alignment,
                                                  const std::filesystem::path& aln,
                                                  std::int64_t num_sections,
                                                  const std::filesystem::path& stack);

/// Writes ascending sections, counted from 1, as parse_section_list() reads them: "1-3,40".
std::string section_list(std::span<const std::int64_t> sections);

/// Parses "1-3,40" to {0, 1, 2, 39}: sorted zero-based sections, each once. Empty text gives none.
/// Throws Error for sections outside 1…num_sections.
std::vector<std::int64_t> parse_section_list(std::string_view text, std::int64_t num_sections);

}  // namespace tomofield::io
