#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "io/images/image_stack.h"
#include "io/tables/alignment_files.h"
#include "tilt_series/section_table.h"
#include "tilt_series/series_plan.h"

namespace tomofield::tilt_series {

/// The tilt angles of the sections of a stack.
struct TiltAngles {
  std::string source;  ///< a file name, or the stack's extended header
  std::vector<std::optional<io::NumberLine>> of_section;
};

/// Returns the tilt angles from the first of: .tlt or .rawtlt, the table that aligns the sections,
/// the .mdoc, the stack's extended header (an explicit file always wins). Throws
/// Error if there is none, or if their number is not the stack's.
TiltAngles find_tilt_angles(const TiltSeriesOptions& options, const io::ImageStack& stack,
                            const std::optional<SectionTable>& table,
                            const std::optional<io::Mdoc>& mdoc);

/// Returns what TiltAngles::source is for angles in the extended header of a stack, or of views in
/// memory.
std::string source_of_header(const io::ImageStack& stack);

/// Throws Error with both numbers and both files unless they are equal.
void require_count(std::size_t found, const std::filesystem::path& file, const char* what,
                   const io::ImageStack& stack);

/// Throws Error that names all of these sections at once whose angle is missing or beyond ±80°
/// (file, line, value), or if the angles of several sections are all the same. Warns of one section
/// alone, and of angles that may be radians. The angles contain `offset_deg` (--tilt-offset).
void require_usable_tilts(const TiltAngles& angles, double offset_deg,
                          std::span<const std::int64_t> sections, const io::ImageStack& stack);

}  // namespace tomofield::tilt_series
