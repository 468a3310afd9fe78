#pragma once

#include <filesystem>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "io/tables/view_table.h"

namespace tomofield::io {

/// No file states a defocus beyond ± 1 mm.
inline constexpr double kLargestDefocus_A = 1e7;

/// The contrast transfer of the views of a series, as a file of another program states it.
struct CtfTable {
  std::filesystem::path file;
  /// The defocus of each section, or of each row of a table of views, in their order; none: the
  /// file leaves it out. Angles are those in the recorded image.
  std::vector<std::optional<Defocus>> views;
  StatedOptics optics;
  std::vector<std::string> not_applied;  ///< what the file has beyond a defocus and a phase shift
  std::vector<std::optional<double>> tilt_deg = {};  ///< of `views`; empty: not in the file
  bool goes_on = false;  ///< the last defocus holds for all views after it, as in IMOD
  /// AreTomo's, whose rows are those of its alignment, sorted by tilt.
  bool is_of_aretomo = false;
  std::vector<std::string> images = {};  ///< of `views`, as the file names them; empty: it does not
  std::vector<std::optional<double>> dose_before = {};  ///< of `views`, as in ListedView
  std::optional<int> defocus_hand = {};                 ///< as in a ViewTable
};

/// Reads the contrast transfer of each view from any of these files, which it recognises by the end
/// of the name (.star, .xml) or by the first lines:
///
/// - the table of CTFFIND 4 and 5, and AreTomo's NAME_CTF.txt, which has the same columns
/// - IMOD's .defocus, versions 2 and 3
/// - a STAR file with rlnDefocusU: a tilt series of RELION 5, or Gctf's
/// - Warp's XML file of a tilt series
///
/// Throws Error with the file and the line for what is missing or cannot be.
CtfTable read_ctf(const std::filesystem::path& path);

/// These read one kind each.
CtfTable read_ctffind(const std::filesystem::path& path);
CtfTable read_imod_defocus(const std::filesystem::path& path);
CtfTable read_relion_ctf(const std::filesystem::path& path);
CtfTable read_warp_ctf(const std::filesystem::path& path);

/// The values of a section that the writers below need.
struct WrittenCtf {
  double tilt_deg = 0.0;
  Defocus defocus;
};

/// Writes the table of CTFFIND 4, with six decimals and all of `optics`. The columns of the fit's
/// quality are 1 and the pixel size times 2.
void write_ctffind(const std::filesystem::path& path, std::span<const WrittenCtf> sections,
                   const StatedOptics& optics, double pixel_size_A);

/// Writes IMOD's .defocus of version 3, one line a section, with astigmatism and, if any section
/// has one, phase shifts. Defocus is in nm with four decimals.
void write_imod_defocus(const std::filesystem::path& path, std::span<const WrittenCtf> sections);

}  // namespace tomofield::io
