#pragma once

#include <array>
#include <cstdint>
#include <filesystem>
#include <optional>
#include <string_view>
#include <vector>

namespace tomofield::io {

// Readers of the small text files that accompany a tilt series. They check
// what a file says by itself and keep line numbers, so that whoever compares
// it with the stack can point at a line. All throw Error with the file, the
// line and its text.

/// A number and the line that it stands on.
struct NumberLine {
  double value = 0.0;
  int line = 0;
};

/// .tlt, .rawtlt, .xtilt: the first number of each line, one line a section.
/// A line that is no number, or not a finite one, is an Error; `quantity`
/// ("tilt angle in degrees") says there what was expected.
std::vector<NumberLine> read_number_column(const std::filesystem::path& path,
                                           std::string_view quantity);

/// IMOD's raw → aligned transform of one section: with p relative to the
/// centre of the raw image and q relative to the centre of the aligned one,
/// in unbinned pixels, q = A p + shift.
struct ImodTransform {
  double a11 = 1.0, a12 = 0.0, a21 = 0.0, a22 = 1.0;
  double shift_x_px = 0.0, shift_y_px = 0.0;
};

/// .xf: `A11 A12 A21 A22 DX DY`, one line a section. A singular A is an Error.
std::vector<ImodTransform> read_imod_transforms(const std::filesystem::path& path);

/// What tomofield uses of one [ZValue = n] section.
struct MdocSection {
  std::int64_t section = 0;  ///< n, zero-based
  int line = 0;              ///< of the tilt angle, or of the section's head
  std::optional<double> tilt_deg;
  std::optional<double> pixel_spacing_A;
};

/// SerialEM's .mdoc, sections in ascending order of n.
struct Mdoc {
  std::optional<double> pixel_spacing_A;  ///< of the series, or of its first section
  std::vector<MdocSection> sections;
};

/// Unknown keys are skipped (SerialEM adds new ones every year); a section
/// that comes twice is an Error.
Mdoc read_mdoc(const std::filesystem::path& path);

/// Global alignment of one section by AreTomo: raw − centre = R(rotation) q + shift.
struct AreTomoRow {
  std::int64_t section = 0;  ///< SEC as written: see assign_aretomo_sections
  int line = 0;
  double rotation_deg = 0.0;  ///< of the tilt axis, counter-clockwise from +Y
  double magnification = 1.0;
  double shift_x_px = 0.0, shift_y_px = 0.0;
  double tilt_deg = 0.0;
};

struct AreTomoAlignment {
  std::optional<std::array<std::int64_t, 3>> raw_size;  ///< of the stack that was aligned
  std::vector<std::int64_t> dark_sections;              ///< second number of each # DarkFrame
  double alpha_offset_deg = 0.0;                        ///< already contained in the rows' angles
  double beta_offset_deg = 0.0;
  std::vector<AreTomoRow> rows;
  std::int64_t num_local_rows = 0;  ///< patches' rows, which are not used
};

AreTomoAlignment read_aretomo_alignment(const std::filesystem::path& path);

/// Zero-based section of the stack for each row. AreTomo's versions count SEC
/// from 0 or 1, and before or after its removal of dark frames, and the stack
/// may be the one before or after: the only numbering in which all rows fit
/// `num_sections` is taken. Throws Error (both numbers, both files) when none is.
std::vector<std::int64_t> assign_aretomo_sections(const AreTomoAlignment& alignment,
                                                  const std::filesystem::path& aln,
                                                  std::int64_t num_sections,
                                                  const std::filesystem::path& stack);

/// "1-3,40" → {0, 1, 2, 39}: sorted zero-based sections, each once; empty
/// text gives none. Sections outside 1…num_sections are an Error.
std::vector<std::int64_t> parse_section_list(std::string_view text, std::int64_t num_sections);

}  // namespace tomofield::io
