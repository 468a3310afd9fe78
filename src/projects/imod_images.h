#pragma once

#include <filesystem>
#include <optional>
#include <string>

#include "projects/command_entries.h"

namespace tomofield::projects {

/// The images that this program reads in place of the aligned stack that IMOD's tilt reads, and how
/// their views lie over it. Lengths are unbinned pixels, those of IMOD's raw stack.
struct ImodImages {
  std::filesystem::path stack;
  std::int64_t num_sections = 0;
  double pixel_size_A = 0.0;     ///< in the header of `stack`
  bool is_raw = false;           ///< the raw stack and its transforms, else the aligned stack
  double bin = 1;                ///< of the aligned stack
  double unit = 1;               ///< a pixel of `stack`: `bin` if that is aligned
  double width = 0, height = 0;  ///< of the aligned views as this program makes them
  double imod_width = 0, imod_height = 0;       ///< of the aligned stack
  double imod_offset_x = 0, imod_offset_y = 0;  ///< its centre, from that of the views
  bool has_newst = false;
  bool is_phase_flipped = false;  ///< the stack went through ctfphaseflip, as its labels say
  std::string series_name;        ///< eTomo's name of the dataset: "TS_01" of "TS_01_ali.mrc"
  std::string
      size_entry;  ///< what the size of the aligned stack follows from; empty: from its file
};

/// Chooses the images: the raw stack and its transforms if both are there, as newst.com names them
/// or under the usual names, else the aligned stack. Sets the stack, --xf and --bin. Throws Error
/// if neither can be used. `newst` is null if there is no newst.com.
ImodImages choose_imod_images(Project& project, CommandEntries& tilt, CommandEntries* newst);

}  // namespace tomofield::projects
