#pragma once

#include <cstddef>
#include <cstdint>
#include <span>

#include "io/images/mrc.h"
#include "io/images/mrc_format.h"

namespace tomofield::io {

/// The layouts of extended headers that have a record for each section.
enum class ExtendedLayout {
  kNone,      ///< none, or one that is not read
  kSerialEm,  ///< SERI: the tilt is a 16-bit number in hundredths of a degree
  kFei,       ///< FEI1 and FEI2: records of the length that each states, with a mask of what it has
  kFloats,    ///< UCSF's, and those of Xplore3D: integers and floats; float 0 is the tilt
};

/// The description of an extended header in the fixed one.
struct ExtendedRecords {
  ExtendedLayout layout = ExtendedLayout::kNone;
  std::int64_t bytes_per_section = 0;
  std::int64_t first_float = 0;  ///< byte of the record (kFloats)
  std::int64_t num_floats = 0;   ///< (kFloats)
  bool is_fei = false;           ///< kFloats: FEI wrote it, whose axis has the opposite sign
  int flags = 0;                 ///< kSerialEm: of what a record has
};

/// Returns the layout of the extended header of a file with this fixed header. The record of kFei
/// states its own length: its `bytes_per_section` is 0.
ExtendedRecords find_extended_records(const MrcHeaderBytes& bytes, const MrcHeader& header);

/// Reads the tilt angles, the pixel size, the tilt axis and the voltage from the bytes of an
/// extended header into `header`; what it does not state, or what cannot be, stays as it is. The
/// pixel size is taken if the fixed header has none. Follows IMOD's `extracttilts` and `header`
/// (extraheader.c, header.f90), and the description of FEI1 by EPU's manual.
void read_extended_records(std::span<const std::byte> extended, const ExtendedRecords& records,
                           MrcHeader& header);

}  // namespace tomofield::io
