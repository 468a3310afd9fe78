#pragma once

#include <filesystem>
#include <string>
#include <string_view>

#include "io/tables/view_table.h"
#include "projects/project.h"

namespace tomofield::projects {

/// Sets --ctf to the contrast transfer that lies beside a series under its name, NAME.defocus
/// (IMOD), NAME_CTF.txt (AreTomo) or NAME_ctf.star. With a contrast transfer, there or given by the
/// user, sets --mtf to the only STAR file of the folder that has a detector's transfer function and
/// "mtf" in its name. Returns true if a contrast transfer lies beside the series.
bool set_transfer_files(Project& project, const std::filesystem::path& folder,
                        const std::string& name);

/// Does the same for tilt.com: a DefocusFile of ctfcorrection.com or ctfplotter.com that is there
/// comes before the names.
bool set_imod_transfer(Project& project, const std::filesystem::path& tilt_com,
                       const std::string& name);

/// Sets --ctf to a table of views, by the name of its entry, if every view that is used has a
/// defocus. Otherwise warns why its contrast transfer is not applied, if it has a part of it and
/// the user gave no other one. Returns true if it has it.
bool set_transfer_of_views(Project& project, const io::ViewTable& table, std::string_view entry);

/// The names of the entries of a file that state the microscope.
struct OpticsEntries {
  std::string_view voltage, spherical_aberration, amplitude_contrast;
};

/// Sets what a file states of the microscope: --voltage, on which a dose depends, too, and, beside
/// a contrast transfer, --cs and --amplitude-contrast.
void set_stated_optics(Project& project, const io::StatedOptics& optics,
                       const std::filesystem::path& file, const OpticsEntries& entries,
                       bool has_transfer);

/// The stack that is read: the pixel size in its header, and whether it is the raw one or the
/// aligned one, whose pixels are larger by `bin`.
struct StackPixels {
  double in_header_A = 0.0, bin = 1.0;
  bool is_raw = true;
};

/// Sets --voltage, --cs, --amplitude-contrast and --pixel-size from ctfplotter.com or
/// ctfcorrection.com beside tilt.com (ctfplottera.com beside tilta.com). The second and the third
/// describe a contrast transfer: they are set if there is one. Warns of entries that change it and
/// are not applied. Throws Error for a value that is none, or that comes twice.
void set_imod_optics(Project& project, const std::filesystem::path& tilt_com,
                     const StackPixels& pixels, bool has_transfer);

}  // namespace tomofield::projects
