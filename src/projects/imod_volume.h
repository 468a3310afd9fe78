#pragma once

#include "projects/imod_images.h"

namespace tomofield::projects {

/// Sets where the volume lies in the views, from the entries THICKNESS, SHIFT, WIDTH, SLICE,
/// OFFSET, FULLIMAGE and SUBSETSTART of tilt.com: --thickness, --shift-z, --roi and --center.
void set_imod_volume(Project& project, CommandEntries& tilt, const ImodImages& images);

}  // namespace tomofield::projects
