#pragma once

#include <optional>
#include <vector>

#include "measurement/section_rows.h"
#include "microscope/exposure.h"
#include "tomofield/options.h"

namespace tomofield::measurement {

using Exposures = std::vector<microscope::Exposure>;  ///< [section], electrons per Å²

/// Returns the exposure of each section of a stack, or nothing if it is not known, or not wanted
/// (--dose-per-tilt 0, --dose-weighted). Doses come from --dose-per-tilt, which has its order from
/// the first of these files that has one: --mdoc, the table of views that is the stack, --tlt, and
/// the file of --ctf; else from the same files. Logs what it took. Throws Error for doses in which
/// no specimen keeps a signal, and for a file that is not of this stack.
std::optional<Exposures> find_exposures(const SeriesFiles& files, const ViewOptions& options,
                                        const Sections& sections);

}  // namespace tomofield::measurement
