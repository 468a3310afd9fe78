#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "geometry/raw_from_aligned.h"
#include "io/images/image_stack.h"
#include "io/tables/alignment_files.h"
#include "io/tables/view_table.h"

namespace tomofield::tilt_series {

using Angles = std::vector<std::optional<double>>;  ///< [section]; none: not stated

/// The alignment of one section of a stack.
struct AlignedSection {
  double tilt_deg = 0.0;
  double x_tilt_deg = 0.0;
  double rotation_deg = 0.0;  ///< of the tilt axis, counter-clockwise from +Y
  geometry::RawFromAligned raw_from_aligned;
  int line = 0;  ///< of the file that says so; 0: not known
};

/// The angles and the alignment of each section that one file gives: AreTomo's .aln, or a table of
/// views of RELION or Warp.
struct SectionTable {
  std::string source;                                     ///< the name of the file
  std::vector<std::optional<AlignedSection>> of_section;  ///< none: left out by that program
  /// [section]: what AreTomo moves by itself; empty without a local alignment.
  std::vector<std::vector<io::AreTomoPatch>> patches = {};
  Angles nominal_tilt_deg = {};  ///< those of the microscope, beside refined ones; else empty
  std::optional<double> nominal_axis_deg = {};  ///< of the first view, beside a refined one
  bool is_nominal = false;  ///< the angles are those of the microscope, and nothing is aligned yet
};

/// Reads AreTomo's .aln. Throws Error if it is not of this stack. `needs_tilt`: no other file has
/// the tilt angles.
SectionTable sections_of_aretomo(const std::filesystem::path& path, const io::ImageStack& stack,
                                 bool needs_tilt);

/// Converts a table of views to unbinned pixels and to this program's centres (docs/geometry.md).
/// `stack` has the images that the table lists.
SectionTable sections_of_views(const io::ViewTable& table, const io::ImageStack& stack,
                               double pixel_size_A);

/// Gives a view of a table the angles and the shift of an aligned section: the inverse of
/// sections_of_views(). A magnification is lost, since tables have none.
void set_alignment(const AlignedSection& section, io::CentreRule centre,
                   const io::MrcHeader& images, double pixel_size_A, io::ListedView& view);

}  // namespace tomofield::tilt_series
