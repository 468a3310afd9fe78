#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "io/images/image_stack.h"
#include "io/tables/alignment_files.h"
#include "tilt_series/section_table.h"
#include "tilt_series/tilt_angles.h"
#include "tilt_series/tilt_axis.h"

namespace tomofield::tilt_series {

// Files of one series may state the same things. These warn where they contradict what is used, as
// where a list is in another order than the sections of the stack.

/// Tells whether angles differ from others by more than a common offset and 3°.
bool are_other_angles(const Angles& angles, const Angles& others);

/// Warns if angles differ from those of another source by more than a common offset and 3°.
void warn_of_other_angles(const Angles& angles, const std::string& source, const Angles& others,
                          const std::string& other_source);

/// Warns if the angles that are used differ from those of the .mdoc by more than a common offset,
/// or if the .mdoc has another number of sections and they do not match by tilt.
void warn_of_other_angles(const TiltAngles& used, const std::filesystem::path& path,
                          const io::Mdoc& mdoc, const io::ImageStack& stack);

/// Does the same with the angles in the extended header of the stack.
void warn_of_other_angles(const TiltAngles& used, const io::ImageStack& stack);

/// Does the same with those of the table that aligns the views.
void warn_of_other_angles(const TiltAngles& used, const SectionTable& table);

/// Warns if the angles of a table differ from the nominal ones that it has, too.
void warn_of_other_nominal_angles(const SectionTable& table);

/// Warns if another file states another tilt axis than the one that is used.
void warn_of_two_axes(const StatedAxis& used, const std::optional<StatedAxis>& other);

/// Says that an alignment (a file, for messages) turns the views by another axis than the one that
/// is stated. Returns nothing if it does not.
std::optional<std::string> contradiction_of_axis(const StatedAxis& stated, double aligned_axis_deg,
                                                 const std::string& alignment);

/// Warns if an alignment turns the views by another axis than the one that a file states.
void warn_of_other_axis(const StatedAxis& stated, double aligned_axis_deg,
                        const TiltSeriesOptions& options, const io::ImageStack& stack);

/// Does the same for an axis that may be the opposite one.
void warn_of_other_line(const StatedAxis& stated, double aligned_axis_deg,
                        const TiltSeriesOptions& options, const io::ImageStack& stack);

/// Warns if an alignment turns some views by another axis than the mean.
void warn_of_turned_views(const Angles& axes_deg, double mean_deg, const TiltSeriesOptions& options,
                          const io::ImageStack& stack);

/// Warns if --tilt-axis is another axis than the one that files state, if they do.
void warn_of_given_axis(double given_deg, const std::optional<StatedAxis>& stated);

/// Warns that a raw stack is aligned whose tilt axis no file states.
void warn_of_unknown_axis(const io::ImageStack& stack);

}  // namespace tomofield::tilt_series
