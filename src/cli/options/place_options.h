#pragma once

#include <CLI/CLI.hpp>
#include <optional>
#include <string>

#include "evaluate/contrast.h"
#include "evaluate/profile.h"

namespace tomofield::cli {

/// The form of a box or of a line's two ends on the command line.
inline constexpr const char* kBoxType = "X0,Y0,Z0,X1,Y1,Z1";

/// Parses a box of whole numbers. Returns nothing for any other text.
std::optional<base::Box> parse_box(const std::string& text);
/// Returns the check of an option that takes a box.
CLI::Validator box_check();

/// Adds --foreground and --background, which need each other. `volume` names the volume whose
/// voxels count.
void add_region_options(CLI::App& command, const std::string& volume, const char* group,
                        evaluate::Regions& regions);
/// Adds --profile, a line between two points.
CLI::Option* add_profile_option(CLI::App& command, const char* help, const char* group,
                                std::optional<evaluate::LineSegment>& line);

}  // namespace tomofield::cli
