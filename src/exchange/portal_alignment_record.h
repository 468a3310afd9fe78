#pragma once

#include <filesystem>

#include "options/run_options.h"
#include "tilt_series/planned_series.h"

namespace tomofield::exchange {

/// Writes the alignment of the views beside the tomogram, as the CryoET Data Portal has it
/// (alignment_metadata.json). With positions from the middles of the specimen and of the recorded
/// view, in unbinned pixels,
///
///     view = in_plane_rotation · Ry(tilt_angle) · Rx(volume_x_rotation) · specimen
///            + (x_offset, y_offset),
///
/// which is the projection of docs/geometry.md; z_index counts the sections of the stack from 0.
/// Views that were left out are not in it. The sizes are those of the volume whose contents are in
/// the file `volume`, in Å; volume_offset is its middle relative to the middle of the aligned view
/// and the tilt axis. A volume that is mirrored in Z has the angles with the sign turned.
void write_portal_alignment(const tilt_series::PlannedSeries& series,
                            const options::ReconstructOptions& options,
                            const std::filesystem::path& volume);

}  // namespace tomofield::exchange
