#pragma once

#include "projects/project.h"

namespace tomofield::projects {

// Each reads one kind of project (Format::read) and has a file of its own.

/// Reads eTomo's tilt.com and the newst.com beside it. Sets the raw stack and its transforms, or
/// the aligned stack, and what the reconstruction needs.
void read_imod_project(Project& project);
/// Does the same for a tilt.com beside the file of the request.
void read_imod_project(Project& project, const std::filesystem::path& tilt_com);

/// Reads eTomo's .edf: the tilt.com in its folder, or, where there is none yet, the files that
/// eTomo names after the dataset.
void read_edf_project(Project& project);

/// Reads AreTomo's .aln. The stack lies beside it.
void read_aretomo_project(Project& project);

/// Reads RELION 5's tomograms.star, or the STAR file of one tilt series. The latter becomes the
/// stack: it lists the images (io/tables/view_table.h).
void read_relion_project(Project& project);

/// Reads a .tomostar or an XML file of Warp, which becomes the stack.
void read_warp_project(Project& project);

/// Reads SerialEM's .mdoc. The stack lies beside it, or the images of the views, a file each.
void read_mdoc_project(Project& project);

}  // namespace tomofield::projects
