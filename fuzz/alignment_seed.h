#pragma once

#include "align/alignment_record.h"

namespace tomofield::fuzz {

/// Returns what the alignment that write_seeds writes was made from.
inline alignment::AlignmentOrigin alignment_origin() {
  return {.num_sections = 3,
          .size_px = {24, 20},
          .files = {},
          .header_tilts = "00",
          .pixels = "00",
          .made_with = {{"seed", 1}}};
}

}  // namespace tomofield::fuzz
